"""The layout of an experiment's folder: which file lies where (runs/README.md).

<experiment>/                 config.yaml, specs/, manifest.json, log.txt, the tables and the report
<experiment>/<case>/          pictures of the case
<experiment>/<case>/seed_<k>/ one run
"""

from __future__ import annotations

from pathlib import Path

# Files of an experiment.
CONFIG, MANIFEST, SPECS, START, LOG, LOCK = (
    "config.yaml",
    "manifest.json",
    "specs",
    "start.npz",
    "log.txt",
    ".lock",
)
CURVES, SUMMARY, SUMMARY_PAGE, REPORT, PAGE, FIGURE, CLAUSES_FIGURE = (
    "learning_curves.csv",
    "summary.csv",
    "summary.md",
    "report.md",
    "report.html",
    "learning_curves",
    "clauses",
)
# Files of a case.
WORKSPACE, CALM_WORKSPACE = "workspace", "workspace_calm"
# Files of a run.
PROGRESS, CLAUSES, TIMING, POLICY, CALM, DONE, CHECKPOINT, CALM_CHECKPOINT, LAST = (
    "progress.csv",
    "clauses.csv",
    "timing.csv",
    "policy.npz",
    "calm.npz",
    "done.json",
    "checkpoint.npz",
    "calm_checkpoint.npz",
    "last.npz",
)
# Files of a search.
SEARCH, JOURNAL, TRIALS = "search.yaml", "journal.log", "trials.csv"


def run_folder(folder: Path, case: str, seed: int) -> Path:
    """The folder of a run in the folder of its experiment."""
    return folder / case / f"seed_{seed}"


def run_of(path: Path) -> tuple[str, int]:
    """The case and the seed of a run's folder."""
    return path.parent.name, int(path.name.removeprefix("seed_"))
