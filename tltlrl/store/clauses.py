"""The columns of a run's clauses.csv, and which clause decides in its last row.

The columns are `iteration` and, for every part of the formula, `KIND MEASURE: PART`, such as `clause decides: G safe`.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

from tltlrl.store.layout import CLAUSES
from tltlrl.store.run import robustness_so_far, whole_lines

CLAUSE, NAME = "clause", "name"
MEAN, BEST, MET, KEPT, DECIDES = "mean", "best", "met", "kept", "decides"
MEASURES = {CLAUSE: (MEAN, BEST, MET, DECIDES), NAME: (MEAN, BEST, MET, KEPT, DECIDES)}


def column(kind: str, measure: str, part: str) -> str:
    """The name of the column for one measure of one part."""
    return f"{kind} {measure}: {part}"


def parts_in(columns: list[str], kind: str) -> list[str]:
    """The clauses, or the named sub-formulas, that have columns in a table, in the order of the spec."""
    prefix = column(kind, MEAN, "")
    return [name.removeprefix(prefix) for name in columns if name.startswith(prefix)]


def standing_so_far(folder: Path) -> str:
    """Where a run stands, from the last rows it wrote: "robustness -0.125, `G safe` decides 93 %"."""
    robustness, deciding = robustness_so_far(folder), deciding_so_far(folder)
    said = [] if robustness is None else [f"robustness {robustness:+.3f}"]
    if deciding is not None:
        said.append(f"`{deciding[0]}` decides {100 * deciding[1]:.0f} %")
    return ", ".join(said)


def deciding_so_far(folder: Path) -> tuple[str, float] | None:
    """The clause that decides most trajectories in the last row written, and their share; None without a row."""
    try:
        rows = list(csv.DictReader(io.StringIO(whole_lines(folder / CLAUSES))))
        shares = {part: float(rows[-1][column(CLAUSE, DECIDES, part)]) for part in parts_in(list(rows[-1]), CLAUSE)}
    except (OSError, ValueError, KeyError, IndexError):
        return None
    return max(shares.items(), key=lambda item: item[1]) if shares else None
