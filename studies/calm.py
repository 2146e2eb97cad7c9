"""What a calm motion gains: every learned policy of some result folders, as learned and made calm.

python -m studies.calm runs/reach_avoid_best runs/visit_in_order_best --batches 100 --trials 100 --output calm.csv

A row per run and policy (`learned` or `calm`), as `algorithm.calm` makes it: the measures of its noise-free motion, its
robustness, the noisy trials that satisfy the spec, and the episodes that simplifying took. Runs that violate their spec
have no calm row.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import pandas as pd

from studies.smoothness import finished
from tltlrl.experiments.results import open_run
from tltlrl.simulation.motion import MEASURES
from tltlrl.training.build import set_up
from tltlrl.training.calm import begin, calm_policy, simplified
from tltlrl.training.verdict import judge


def rows_of(folder: Path, batches: int, share: float, trials: int) -> list[dict[str, Any]]:
    """Both policies of one finished run; the calm one only where the learned one satisfies its spec."""
    run, policy = open_run(folder)
    run = dataclasses.replace(run, trials=trials)
    setup = set_up(run)
    labels = {"folder": folder.parents[1].name, "case": run.case.name, "seed": run.seed, "trials": trials}

    def row(name: str, found: dict[str, Any], **cost: int) -> dict[str, Any]:
        outcomes = {f"trials_{outcome}": value for outcome, value in found["outcomes"].items()}
        worth = {"robustness": found["robustness_policy"], "trials_satisfied": found["successes"]}
        return labels | {"policy": name} | worth | outcomes | found["motion"] | cost

    learned = judge(run, setup, policy)
    rows = [row("learned", learned, batches=0, episodes=0)]
    if learned["satisfied"]:
        *_, calm = simplified(
            run, setup, policy, learned["robustness_policy"], share, batches, begin(run, setup, policy)
        )
        found = judge(run, setup, calm_policy(policy, calm))
        rows.append(row("calm", found, batches=calm.batches, episodes=calm.episodes))
    return rows


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """Medians, and the worst of what is to be reached, by folder, case and policy."""
    groups = table.groupby(["folder", "case", "policy"])
    shown = ["robustness", "path_length", "acceleration_rms", "jerk_rms", "commands_at_limit", "time_to_satisfaction"]
    medians = groups[shown].median()
    worst = groups[["path_length", "acceleration_rms"]].max().add_suffix(" (most)")
    counts = groups[[name for name in table if name.startswith("trials")]].sum()
    return pd.concat([groups.size().rename("seeds"), medians, worst, counts, groups["episodes"].median()], axis=1)


def main(arguments: Sequence[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, help="result folders such as runs/toast")
    parser.add_argument("--batches", type=int, default=100)
    parser.add_argument("--share", type=float, default=0.7, help="of the learned robustness that is kept")
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--output", type=Path, help="a CSV file, written anew after every run")
    a = parser.parse_args(arguments)
    paths = [path for folder in a.folders for path in finished(folder)]
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(a.workers) as pool:
        asked = functools.partial(rows_of, batches=a.batches, share=a.share, trials=a.trials)
        for both in pool.map(asked, paths):
            rows += both
            if a.output:
                pd.DataFrame(rows).to_csv(a.output, index=False)
    table = pd.DataFrame(rows)
    assert set(MEASURES) <= set(table.columns)
    print(overview(table).T.round(4).to_string())


if __name__ == "__main__":
    main(sys.argv[1:])
