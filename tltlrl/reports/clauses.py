"""Shows which part of the spec is stuck: the figure of clauses.csv, and a sentence about every failed run."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.reports.plotting import GREY_STYLES, LABELS, own_style, save
from tltlrl.store.clauses import BEST, CLAUSE, DECIDES, MEAN, MET, NAME, column, parts_in
from tltlrl.store.layout import CLAUSES, run_of
from tltlrl.store.run import whole_lines

Array = NDArray[np.float64]

WINDOW = 10  # iterations over which the share that a clause decides is averaged
MOST = 8  # clauses, or named sub-formulas, in a figure
LONG = 44  # characters of a clause in a legend
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 8}


@dataclass(frozen=True)
class Standing:
    """The values of a spec's parts in one run, or averaged over several.

    Attributes:
      clauses, names: the clauses, and the names of the named sub-formulas.
      table: iteration and the columns of clauses.csv.
    """

    clauses: tuple[str, ...]
    names: tuple[str, ...]
    table: pd.DataFrame

    def values(self, kind: str, measure: str, part: str) -> Array:
        """The values of one column, one per iteration."""
        return self.table[column(kind, measure, part)].to_numpy(dtype=float)


def read_standing(run: Path) -> Standing | None:
    """Reads clauses.csv of a run, finished or not; None if there is none, as in results before 0.3.

    Raises:
      UserError: if it cannot be read.
    """
    path = run / CLAUSES
    if not path.exists() or not (text := whole_lines(path)):
        return None
    try:
        table = pd.read_csv(io.StringIO(text), dtype=float)
    except ValueError as error:
        raise UserError(f"{path} cannot be read ({error}); start its tltl-run again, which mends it") from error
    columns = list(table.columns)
    return Standing(tuple(parts_in(columns, CLAUSE)), tuple(parts_in(columns, NAME)), table)


def standings(runs: Iterable[Path]) -> dict[str, dict[int, Standing]]:
    """Case => seed => the values of the spec's parts, for every run with a clauses.csv."""
    found: dict[str, dict[int, Standing]] = {}
    for run in runs:
        case, seed = run_of(run)
        if (own := read_standing(run)) is not None and len(own.table):
            found.setdefault(case, {})[seed] = own
    return found


def averaged(runs: Sequence[Standing]) -> Standing:
    """The mean over several runs of one spec, up to the iteration that all of them reached."""
    length = min(len(run.table) for run in runs)
    mean = np.mean([run.table.iloc[:length].to_numpy() for run in runs], axis=0)
    return Standing(runs[0].clauses, runs[0].names, pd.DataFrame(mean, columns=runs[0].table.columns))


def stuck(run: Standing, asked: Mapping[str, Sequence[str]], samples: int) -> str:
    """A sentence: what decided the last trajectories of a run, since when, and how few met what the clause asks for.

    Args:
      run: the values of the spec's parts.
      asked: clause => the named sub-formulas in it that are to hold (`Spec.asks_for`).
      samples: trajectories per iteration.
    """
    shares = np.stack([run.values(CLAUSE, DECIDES, clause) for clause in run.clauses], axis=1)
    sums = np.cumsum(np.concatenate([np.zeros((1, shares.shape[1])), shares]), axis=0)
    last = np.arange(1, len(shares) + 1)
    recent = (sums[last] - sums[np.maximum(last - WINDOW, 0)]).argmax(axis=1)
    others = np.flatnonzero(recent != recent[-1])
    begin = int(others[-1]) + 1 if len(others) else 0
    begin = min(begin, max(len(shares) - WINDOW, 0))  # if two decide in turn, the latest turn says little
    clause, total = run.clauses[recent[-1]], samples * (len(shares) - begin)

    def met(kind: str, part: str) -> int:
        return round(float(run.values(kind, MET, part)[begin:].sum() * samples))

    since = f"from iteration {begin} on" if begin else "throughout"
    share, by_clause = shares[begin:, recent[-1]].mean(), met(CLAUSE, clause)
    said = [f"{since} `{clause}` decides {100 * share:.0f} %", f"it was met by {by_clause} of {total} trajectories"]
    names = {name: met(NAME, name) for name in asked.get(clause, ()) if name in run.names}
    if names and (least := min(names, key=lambda name: names[name])) and names[least] not in (total, by_clause):
        said.append(f"`{least}` at some moment by {names[least]}")
    return "; ".join(said)


def stuck_lines(
    finished: Mapping[Path, Mapping[str, Any]],
    known: Mapping[str, Mapping[int, Standing]],
    asked: Mapping[str, Sequence[str]],
    samples: int,
) -> list[str]:
    """One line for every run whose mean policy violates the spec, if anything is known of it."""
    lines = []
    for path, done in finished.items():
        case, seed = run_of(path)
        if not done["satisfied"] and seed in known.get(case, {}):
            lines.append(f"- {case} seed {seed}: {stuck(known[case][seed], asked, samples)}.")
    if not lines:
        return []
    return ["", "Of the sampled trajectories of each failed seed:", "", *lines]


def plot_clauses(cases: Mapping[str, Mapping[int, Standing]], path: Path) -> None:
    """Draws `clauses_figure` as path.png and path.pdf; `path` is without suffix."""
    with own_style():
        save(clauses_figure(cases), path)


def clauses_figure(cases: Mapping[str, Mapping[int, Standing]]) -> Figure:
    """The figure of the clauses, one row per case, with means over the seeds.

    Its columns are the share of sampled trajectories that each clause decides, the clauses' mean robustness, and the
    share of trajectories in which each named sub-formula held at some sample.

    Args:
      cases: case => seed => the values of the spec's parts.
    """
    means = {case: averaged(list(runs.values())) for case, runs in cases.items()}
    first = next(iter(means.values()))
    clauses = _most(first.clauses, [(mean, CLAUSE) for mean in means.values()])
    names = _most(first.names, [(mean, NAME) for mean in means.values()])
    columns = 3 if names else 2
    with own_style():
        figure = Figure(figsize=(2.3 * columns, 1.8 + 0.18 * max(len(clauses), len(names)) + 1.5 * len(cases)))
        figure.set_layout_engine("constrained")
        grid = figure.subplots(len(cases), columns, squeeze=False, sharex="col")
        for row, (case, mean) in zip(grid, means.items(), strict=True):
            _draw(row[0], {clause: 100 * mean.values(CLAUSE, DECIDES, clause) for clause in clauses})
            for measure, width in ((BEST, 0.5), (MEAN, 1.3)):
                _draw(row[1], {clause: mean.values(CLAUSE, measure, clause) for clause in clauses}, width)
            _limit(row[1], [mean.values(CLAUSE, measure, clause) for clause in clauses for measure in (BEST, MEAN)])
            row[1].axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
            if names:
                _draw(row[2], {name: 100 * mean.values(NAME, MET, name) for name in names})
            for axes in (row[0], *row[2:]):
                axes.set_ylim(-4, 104)
            row[0].set_ylabel(LABELS.get(case, case).replace(", ", ",\n"))
        titles = (
            "decides,\n% of samples",
            "robustness of samples:\nmean (thin: best)",
            "met at some moment,\n% of samples",
        )
        for axes, title in zip(grid[0], titles, strict=False):
            axes.set_title(title)
        for axes in grid[-1]:
            axes.set_xlabel("iteration")
            axes.locator_params("x", integer=True)
        lines = grid[0][0].get_legend_handles_labels()
        figure.legend(*lines, title="clauses", loc="outside upper left", **LEGEND)
        if names:
            lines = grid[0][2].get_legend_handles_labels()
            figure.legend(*lines, title="named sub-formulas", loc="outside upper right", **LEGEND)
        figure.supxlabel(_caption(cases, first, clauses, names), fontsize=7)
    return figure


def _most(parts: Sequence[str], means: Sequence[tuple[Standing, str]]) -> list[str]:
    """The parts that decide most, in the order of the spec."""
    decided = {part: sum(mean.values(kind, DECIDES, part).sum() for mean, kind in means) for part in parts}
    chosen = sorted(parts, key=lambda part: -decided[part])[:MOST]
    return [part for part in parts if part in chosen]


def _caption(
    cases: Mapping[str, Mapping[int, Standing]], of: Standing, clauses: Sequence[str], names: Sequence[str]
) -> str:
    counts = sorted({len(runs) for runs in cases.values()})
    seeds = " and ".join(f"{n} seed{'s' * (n > 1)}" for n in counts)
    more = len(of.clauses) - len(clauses) + len(of.names) - len(names)
    left = f" {more} parts that decide less are left out." if more else ""
    return f"Means of {seeds}. A clause decides a trajectory whose robustness is its own.{left}"


def _draw(axes: Axes, curves: Mapping[str, Array], width: float = 1.3) -> None:
    for style, (part, values) in zip(GREY_STYLES, curves.items(), strict=False):
        label = part if len(part) <= LONG else f"{part[: LONG - 1]}…"
        axes.plot(np.where(np.isfinite(values), values, np.nan), linewidth=width, label=f" {label}", **style)
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)


def _limit(axes: Axes, curves: Sequence[Array]) -> None:
    """Sets the y axis without the first tenth of the iterations, which lies far below the rest."""
    later = np.concatenate([values[len(values) // 10 :] for values in curves])
    later = later[np.isfinite(later)]
    if len(later) and later.max() > later.min():
        margin = 0.08 * (max(later.max(), 0.0) - later.min())
        axes.set_ylim(later.min() - margin, max(later.max(), 0.0) + margin)
