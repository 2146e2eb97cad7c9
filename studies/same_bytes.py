"""Do two versions of tltlrl give the same results, to the byte?

    python -m studies.same_bytes OLD NEW

OLD and NEW are folders of experiments, as `runs_dir`. Compared are progress.csv and every array of policy.npz of every
run that OLD holds. Exit code 0: all the same; 1: something differs; 2: a folder or a run is missing.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

PROGRESS, POLICY = "progress.csv", "policy.npz"


def runs(folder: Path) -> list[Path]:
    """Paths <experiment>/<case>/seed_<k> of the runs in a folder of experiments, relative to it."""
    return sorted(path.relative_to(folder) for path in folder.glob("*/*/seed_*") if path.is_dir())


def difference(old: Path, new: Path) -> str | None:
    """What differs first between two runs' folders; none if nothing does."""
    ours, theirs = ((folder / PROGRESS).read_bytes() for folder in (old, new))
    if ours != theirs:
        a, b = ours.splitlines(keepends=True), theirs.splitlines(keepends=True)
        lines = zip(a, b, strict=False)
        line = next((i for i, (x, y) in enumerate(lines) if x != y), min(len(a), len(b)))
        return f"{PROGRESS} differs first in line {line + 1}"
    with np.load(old / POLICY, allow_pickle=False) as before, np.load(new / POLICY, allow_pickle=False) as after:
        if set(before.files) != set(after.files):
            return f"{POLICY} has the arrays {', '.join(sorted(after.files))} and had {', '.join(sorted(before.files))}"
        for name in before.files:
            a, b = before[name], after[name]
            if (a.dtype, a.shape) != (b.dtype, b.shape):
                return f"{name} in {POLICY} is {b.dtype} {b.shape} and was {a.dtype} {a.shape}"
            if a.tobytes() != b.tobytes():
                return f"{name} in {POLICY} differs"
    return None


def main(arguments: list[str]) -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m studies.same_bytes", description="Compares the results of two folders of experiments."
    )
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    a = parser.parse_args(arguments)
    for folder in (a.old, a.new):
        if not folder.is_dir():
            return _refuse(f"there is no folder {folder}")
    compared = runs(a.old)
    if not compared:
        return _refuse(f"{a.old} holds no run: <experiment>/<case>/seed_<k>")
    for run in compared:
        for path in (folder / run / name for folder in (a.old, a.new) for name in (PROGRESS, POLICY)):
            if not path.is_file():
                return _refuse(f"{path} is missing")
    found = {run: difference(a.old / run, a.new / run) for run in compared}
    for run, what in found.items():
        print(f"{run}: {what or 'same'}")
    return int(any(found.values()))


def _refuse(message: str) -> int:
    print(message, file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
