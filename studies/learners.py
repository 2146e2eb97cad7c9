"""Learners on every task at equal budget: how soon they satisfy the spec, how near they come to the best.

    python -m studies.learners --seeds 20 --runs runs --output studies/learners.csv

trains what is missing with `tltl-run`, writes one row per run, and prints a row per task and learner. Runs of
`experiment=TASK` and of `experiment=TASK_best` with as many seeds are taken from RUNS/TASK and RUNS/TASK_best; the
others are trained into RUNS/learners_TASK_NAME. `tltl_step` has a table of its own, in docs/online.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from tltlrl.cli.main import run
from tltlrl.store.layout import CURVES, SUMMARY

# No trajectory can be worth more: the goals' radius, and half the slot's width that the spec leaves (m).
BEST = {"reach_avoid": 0.2, "toast": 0.025, "visit_in_order": 0.2}
REUSE = ("algorithm.told=leximin", "algorithm.batches=5", "algorithm.epsilon=2")
CASE = "tltl_episodic"
# The budget, and all else that is not named here, is that of the task's experiment in figure 3.3 or 3.4.
LEARNERS: dict[str, tuple[str, ...]] = {
    "episodic": ("cases=[tltl_episodic]",),
    "episodic_reuse": ("cases=[tltl_episodic]", *REUSE),
    "episodic_basis": ("cases=[tltl_episodic]", "algorithm.basis=10"),
    "cma_basis": ("cases=[tltl_cma]", "algorithm.basis=10"),
    "best": ("cases=[tltl_episodic]", "algorithm.calm=0"),
}


def command(task: str, learner: str, seeds: int, runs: Path) -> list[str]:
    """What `tltl-run` is asked for one task and learner."""
    experiment = f"{task}_best" if learner == "best" else task
    return [
        *(f"experiment={experiment}", f"name=learners_{task}_{learner}", f"runs_dir={runs}", f"seeds={seeds}"),
        *LEARNERS[learner],
    ]


def made_before(task: str, learner: str, seeds: int, runs: Path) -> Path | None:
    """The folder of the user's own experiment, if it has the learner's runs with seeds 0 to `seeds` - 1."""
    name = {"episodic": task, "best": f"{task}_best"}.get(learner)
    if name is None or not (runs / name / SUMMARY).is_file():
        return None
    table = pd.read_csv(runs / name / SUMMARY)
    return runs / name if set(range(seeds)) <= set(table.loc[table["case"] == CASE, "seed"]) else None


def rows_of(folder: Path, task: str, learner: str) -> pd.DataFrame:
    """One row per run of a result folder: what was learned, and after how many iterations it stayed."""
    summary, curves = (pd.read_csv(folder / name) for name in (SUMMARY, CURVES))
    summary, curves = (table[table["case"].isin([CASE, "tltl_cma"])] for table in (summary, curves))
    summary = summary.set_index("seed")
    found = []
    for seed, curve in curves.groupby("seed"):
        learned = summary.loc[seed]
        value = curve["robustness_kept" if "robustness_kept" in curve else "robustness_policy"]
        violated = curve.loc[value <= 0, "iteration"]
        found.append(
            {
                "task": task,
                "learner": learner,
                "seed": seed,
                "iterations": len(curve),
                "episodes": int(curve["episodes"].iloc[-1]),
                "satisfied": bool(learned["satisfied"]),
                "first_satisfied": learned["first_satisfied_iteration"],
                "for_good": int(violated.max()) + 1 if len(violated) else 0,
                "robustness_policy": learned["robustness_policy"],
                "share_of_best": learned["robustness_policy"] / BEST[task],
                "trials": learned["trials"],
                "successes": learned["successes"],
            }
        )
    rows = pd.DataFrame(found)
    rows["for_good"] = rows["for_good"].where(rows["satisfied"]).astype("Int64")
    return rows.astype({"first_satisfied": "Int64", "trials": "int64", "successes": "int64"})


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """One row per task and learner; medians over the seeds, `never` counting as later than all else."""

    def median(iterations: pd.Series) -> str:
        middle = iterations.astype("float64").fillna(float("inf")).median()
        return f"{middle:g}" if middle < float("inf") else "never"

    groups = table.groupby(["task", "learner"], sort=False)
    return pd.DataFrame(
        {
            "episodes": groups["episodes"].first(),
            "satisfied": groups["satisfied"].sum().astype(str) + " of " + groups.size().astype(str),
            "first": groups["first_satisfied"].apply(median),
            "for good": groups["for_good"].apply(median),
            "robustness": groups["robustness_policy"].median().round(4),
            "least": groups["robustness_policy"].min().round(4),
            "share of best": groups["share_of_best"].median().round(2),
            "trials": groups["successes"].sum().astype(str) + " of " + groups["trials"].sum().astype(str),
        }
    ).reset_index()


def main(arguments: Sequence[str] | None = None) -> int:
    """Trains, collects and prints; the table grows as it goes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--runs", type=Path, default=Path("runs"), metavar="FOLDER")
    parser.add_argument("--output", type=Path, required=True, metavar="FILE.csv")
    parser.add_argument("overrides", nargs="*", help="for every experiment, as in algorithm.iterations=5")
    asked = parser.parse_args(arguments)
    tables = []
    for task in BEST:
        for learner in LEARNERS:
            folder = made_before(task, learner, asked.seeds, asked.runs)
            if folder is None:
                if run([*command(task, learner, asked.seeds, asked.runs), *asked.overrides]):
                    return 1
                folder = asked.runs / f"learners_{task}_{learner}"
            tables.append(rows_of(folder, task, learner))
            table = pd.concat(tables, ignore_index=True)
            table.to_csv(asked.output, index=False, lineterminator="\n")
    print(overview(table).to_string(index=False))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
