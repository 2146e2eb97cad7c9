"""The runs of train.py as a table, with REPS beside them: adds the runs of tltl-run to the file and prints it.

python examples/stable_baselines3/table.py results.csv runs/reach_avoid runs/visit_in_order
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

KEY = ["task", "learner", "reward", "steps", "seed"]


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
                "robustness": round(run.robustness_policy, 6),
                "satisfied": round(100 * run.success_rate),
            }
        )
    return pd.DataFrame(rows)


def together(runs: pd.DataFrame, experiments: list[Path]) -> pd.DataFrame:
    """All runs, ordered by task and learner; a run that stands there already is replaced."""
    every = pd.concat([runs, *map(of_reps, experiments)]).drop_duplicates(KEY, keep="last")
    whole = ["first_satisfied", "seconds", "steps", "satisfied"]
    return every.sort_values(KEY, ascending=[True, True, False, True, True]).astype(dict.fromkeys(whole, "Int64"))


def table(runs: pd.DataFrame) -> str:
    """In Markdown, one line per task, learner, reward and budget; a run that never satisfied counts as the longest."""
    lines = [
        "| task | learner | reward | environment steps | satisfied | first satisfied after, median "
        "| robustness, median (min to max) | trials that satisfy |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (task, learner, reward, steps), own in runs.groupby(KEY[:4], sort=False):
        value, first = own.robustness, own.first_satisfied.astype(float).fillna(np.inf).median()
        lines.append(
            f"| {task} | {learner} | {reward} | {steps:,} | {(value > 0).sum()} of {len(own)} | "
            f"{f'{first:,.0f}' if np.isfinite(first) else 'never'} | "
            f"{value.median():.3f} ({value.min():.3f} to {value.max():.3f}) | {own.satisfied.mean():.0f} % |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    results, *folders = map(Path, sys.argv[1:])
    found = together(pd.read_csv(results), folders)
    found.to_csv(results, index=False, lineterminator="\n")
    print(table(found))
