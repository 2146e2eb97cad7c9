"""Toast from poorer starts: what `toast_line` and `toast_rest` learn, one row per run.

    tltl-run experiment=toast_line seeds=20 && tltl-run experiment=toast_rest seeds=20
    python -m studies.starts runs/toast_line runs/toast_rest --output studies/starts.csv

The columns are those of `studies.learners`, and the trials in which the bread comes to rest in the slot.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from studies.learners import overview, rows_of
from tltlrl.store.layout import SUMMARY


def table(folders: Sequence[Path]) -> pd.DataFrame:
    """One row per run of these result folders; `learner` is the name of the folder."""
    tables = []
    for folder in folders:
        rows = rows_of(folder, "toast", folder.name)
        bread = pd.read_csv(folder / SUMMARY).set_index("seed")["bread_in_slot"]
        tables.append(rows.assign(bread_in_slot=rows["seed"].map(bread)))
    return pd.concat(tables, ignore_index=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, help="result folders")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE.csv")
    asked = parser.parse_args(arguments)
    rows = table(asked.folders)
    rows.to_csv(asked.output, index=False, lineterminator="\n")
    bread = rows.groupby("learner", sort=False)["bread_in_slot"].sum()
    print(overview(rows).assign(bread=bread.to_numpy()).to_string(index=False))


if __name__ == "__main__":
    main()
