"""Exports learning curves and clauses as TensorBoard's event files, also while runs go on."""

from __future__ import annotations

import csv
import io
import math
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tltlrl.errors import UserError
from tltlrl.store.layout import CLAUSES, DONE, PROGRESS, run_of
from tltlrl.store.run import begun, whole_lines

FOLLOW_SECONDS = 2.0
WORDS = {"=>": "implies", "!": "not", "&": "and", "|": "or", "<": "below", ">": "above"}


def export(
    experiment: Path, output: Path, follow: bool = False, wait: Callable[[float], None] = time.sleep
) -> dict[Path, int]:
    """Writes output/CASE/seed_K for every run that has written something.

    Args:
      experiment: its folder.
      output: a new or empty folder.
      follow: whether to go on until every run has ended; at least one must have begun.
      wait: waits for some seconds between two looks at the files.

    Returns:
      Folder of a run => its iterations.

    Raises:
      UserError: if the extra is not installed, there are no runs, or the folder holds something.
    """
    try:
        from tensorboardX import SummaryWriter
    except ImportError as error:
        raise UserError(
            "the export needs tensorboardX, an extra: pip install 'tltlrl[tensorboard]'; to look at it, "
            "pip install tensorboard"
        ) from error
    if not begun(experiment):
        raise UserError(f"{experiment} has no runs; give the folder of an experiment, as runs/NAME")
    if output.exists() and any(output.iterdir()):
        raise UserError(f"{output} is not empty, and TensorBoard would show both; delete it or give another --output")
    writers: dict[Path, Any] = {}
    done: dict[tuple[Path, str], int] = {}
    while True:
        # Whether they have ended is looked at first: what is written after it is read the next time.
        runs = begun(experiment)
        ended = all((run / DONE).exists() for run in runs)
        for run in runs:
            case, seed = run_of(run)
            if run not in writers:
                writers[run] = SummaryWriter(str(output / case / f"seed_{seed}"))
            for name, group in ((PROGRESS, ""), (CLAUSES, "clauses/")):
                before = done.get((run, name), 0)
                done[run, name] = before + _add(writers[run], run / name, group, before)
            writers[run].flush()
        if ended or not follow:
            break
        wait(FOLLOW_SECONDS)
    for writer in writers.values():
        writer.close()
    return {run: done[run, PROGRESS] for run in writers}


def _add(writer: Any, path: Path, group: str, before: int) -> int:
    """The rows of a CSV file after the first `before`; how many."""
    if not path.exists():
        return 0
    rows = list(csv.DictReader(io.StringIO(whole_lines(path))))[before:]
    for row in rows:
        for name, text in row.items():
            try:
                value = float(text)
            except ValueError:  # the name of the task or the case, or empty
                continue
            if name not in ("seed", "iteration") and math.isfinite(value):
                writer.add_scalar(f"{group}{tag(name)}", value, int(row["iteration"]))
    return len(rows)


def tag(column: str) -> str:
    """A column's name as TensorBoard takes it: `clause decides: G safe` in the group of its measure."""
    measure, _, part = column.partition(": ")
    for sign, word in WORDS.items():  # else `a U b` and `!a U b` would be one
        part = part.replace(sign, f" {word} ")
    return "/".join(re.sub(r"[^A-Za-z0-9_.-]+", "_", each).strip("_") for each in (measure, part) if each)
