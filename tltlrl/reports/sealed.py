"""Reads an experiment's tables from the sealed files of its runs; learning_curves.csv and summary.csv have no seal."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd

from tltlrl.errors import UserError
from tltlrl.reports.plotting import PANELS
from tltlrl.reports.report import summarise
from tltlrl.store.layout import CURVES, DONE, PROGRESS, SUMMARY, run_folder, run_of
from tltlrl.store.run import DamagedError, begun, joined, sealed_run, whole_lines


def read_curves(folder: Path) -> tuple[pd.DataFrame, list[str]]:
    """Every row that the runs of an experiment have written, unfinished runs included.

    If there are no runs, as beside a copied table, learning_curves.csv is read instead.

    Args:
      folder: folder of the experiment.

    Returns:
      The rows, and warnings: that the table is missing, differs from the runs, or has no runs to prove it.

    Raises:
      UserError: if there are neither runs nor a table, a run's file is not as it was written, or a row is incomplete.
    """
    path, runs = folder / CURVES, begun(folder)
    ended = runs_ended(runs)
    try:
        table = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        if not runs:
            raise UserError(
                f"{path} cannot be read ({error}); give the folder of an experiment, as runs/NAME"
            ) from error
        table = ""
    text, notes = table, []
    if runs:
        order = {run: place for place, run in enumerate(_runs_of(table))}
        runs.sort(key=lambda run: order.get(run_of(run), len(order)))
        text = joined([rows for run in runs if (rows := _rows(run))])
    else:
        notes.append(unproved(path))
    if ended and text != table:
        notes.append(another(path))
    where = folder if runs else path
    try:
        curves = pd.read_csv(io.StringIO(text))
    except ValueError as error:
        raise UserError(f"{where} cannot be read ({error}); give the folder of an experiment, as runs/NAME") from error
    if mistake := _mistake(curves, text, equal=not runs or ended):
        raise UserError(f"{where}: {mistake}; run the experiment again to write it anew")
    return curves, notes


def read_summary(folder: Path) -> tuple[pd.DataFrame, list[str]]:
    """One row per finished run, and warnings, as in `read_curves` but for summary.csv."""
    path, runs = folder / SUMMARY, begun(folder)
    if not any((run / DONE).exists() for run in runs):
        try:
            return pd.read_csv(path), [unproved(path)]
        except (OSError, ValueError) as error:
            raise UserError(f"{path} cannot be read ({error}); tltl-run writes it when a run has finished") from error
    curves, notes = read_curves(folder)
    order = curves[["case", "seed"]].drop_duplicates().itertuples(index=False, name=None)
    finished = [run for case, seed in order if ((run := run_folder(folder, case, seed)) / DONE).exists()]
    text = summarise(curves, {run: sealed_run(run)[0] for run in finished}).to_csv(index=False, lineterminator="\n")
    if runs_ended(runs) and not (path.is_file() and path.read_bytes() == text.encode()):
        notes.append(another(path))
    return pd.read_csv(io.StringIO(text)), notes


def runs_ended(runs: list[Path]) -> bool:
    """Whether there are runs, and all of them have ended."""
    return bool(runs) and all((run / DONE).exists() for run in runs)


def unproved(path: Path) -> str:
    """The warning that a table is used although no runs prove it."""
    return f"{path} is taken as it stands: the runs that would prove it are not there"


def another(path: Path) -> str:
    """The warning that a table is missing or differs from the runs, and is not used."""
    return (
        f"{path} is missing or not what its runs say, so they are read in its place; the experiment's tltl-run writes "
        "it again"
    )


def _rows(run: Path) -> str:
    """The text of a run's progress.csv: as sealed if the run has ended, otherwise its complete lines.

    Raises:
      UserError: if it is not as it was written.
    """
    try:
        return sealed_run(run)[1] if (run / DONE).exists() else whole_lines(run / PROGRESS)
    except DamagedError as error:
        raise UserError(f"{run}: {error}; start its tltl-run again, which computes anew what is damaged") from error


def _runs_of(table: str) -> list[tuple[str, int]]:
    """Case and seed of the runs in a table, in its order, without rows that cannot be read."""
    rows = csv.DictReader(io.StringIO(table))
    return list(
        dict.fromkeys((str(row.get("case")), int(seed)) for row in rows if (seed := str(row.get("seed"))).isdecimal())
    )


def _mistake(curves: pd.DataFrame, text: str, equal: bool) -> str | None:
    """What is wrong with the learning curves of this text, if anything; `equal`: whether all must be as long."""
    needed = {"task", "case", "seed", "iteration", "episodes", *PANELS}
    if missing := needed - set(curves.columns):
        return f"no column {', '.join(sorted(missing))}"
    if not text.endswith("\n"):
        return "its last line is cut off"
    if curves.empty or curves.duplicated(["case", "seed", "iteration"]).any():
        return "empty, or with an iteration twice"
    for name in ("seed", "iteration", "episodes", *PANELS):
        if curves[name].isna().any() or not pd.api.types.is_numeric_dtype(curves[name]):
            return f"{name} has a value that is not a number"
    counts = curves.groupby(["case", "seed"], sort=False)["iteration"].agg(["size", "max"])
    (wrong,) = np.nonzero(equal & (counts["size"] != counts["size"].max()) | (counts["max"] + 1 != counts["size"]))
    if len(wrong):
        case, seed = counts.index[wrong[0]]
        return f"{case} seed {seed} has other iterations than the rest"
    return None
