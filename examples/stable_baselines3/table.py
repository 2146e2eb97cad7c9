"""The runs of train.py and those of tltl-run as one table.

python examples/stable_baselines3/table.py results.csv runs/reach_avoid runs/visit_in_order
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd


def of_reps(experiment: Path) -> pd.DataFrame:
    """What the case tltl_episodic of an experiment learned, one row per seed, with the columns of train.py."""
    summary = pd.read_csv(experiment / "summary.csv").query("case == 'tltl_episodic'")
    rows = []
    for run in summary.itertuples():
        progress = pd.read_csv(experiment / "tltl_episodic" / f"seed_{run.seed}" / "progress.csv")
        satisfied = progress.env_steps[progress.robustness_policy > 0]
        rows.append(
            {
                "task": run.task,
                "learner": "REPS",
                "reward": "final",
                "seed": run.seed,
                "steps": progress.env_steps.iloc[-1],
                "first_satisfied": satisfied.iloc[0] if len(satisfied) else None,
                "robustness": run.robustness_policy,
                "satisfied": 100 * run.success_rate,
            }
        )
    return pd.DataFrame(rows)


def table(runs: pd.DataFrame) -> str:
    """In Markdown, one row per task, learner and reward."""
    lines = [
        "| task | learner | reward | environment steps | satisfied | first satisfied after | robustness, median "
        "(min to max) | trials satisfied |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (task, learner, reward), own in runs.groupby(["task", "learner", "reward"], sort=False):
        value = own.robustness
        # A run that never satisfied counts as longer than all others.
        first = own.first_satisfied.fillna(float("inf")).median()
        lines.append(
            f"| {task} | {learner} | {reward} | {own.steps.iloc[0]:,} | {(value > 0).sum()} of {len(own)} | "
            f"{'never' if first == float('inf') else f'{first:,.0f}'} | "
            f"{value.median():.3f} ({value.min():.3f} to {value.max():.3f}) | {own.satisfied.mean():.0f} % |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    results, *experiments = map(Path, sys.argv[1:])
    print(table(pd.concat([pd.read_csv(results), *map(of_reps, experiments)]).sort_values("task", kind="stable")))
