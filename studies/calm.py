"""How calm learned motions become, and what that costs: measures of motion before and after, for finished runs.

Every finished run of the given result folders is made calm as `algorithm.calm=BATCHES` would have done, whether or not
it was when it was learned; of the learned and of the calm policy, the robustness and the measures of the noise-free
motion, and noisy trials in the evaluation scene, the draws that summary.csv counts.

    python -m studies.calm runs/visit_in_order_best --batches 200 --trials 100 --output calm.csv
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path

import pandas as pd

from studies.smoothness import finished
from tltlrl.experiments.experiment import open_run
from tltlrl.simulation.motion import MEASURES
from tltlrl.training.build import set_up
from tltlrl.training.calm import calmed
from tltlrl.training.verdict import judge


def rows(path: Path, batches: int, trials: int) -> list[dict[str, object]]:
    """One row of the learned policy, and one of the calm one where there is one.

    Args:
      path: of a finished run.
      batches: of shortcuts.
      trials: of each policy.
    """
    run, learned = open_run(path)
    run = dataclasses.replace(run, trials=trials, algorithm=dataclasses.replace(run.algorithm, calm=batches))
    setup = set_up(run)
    calm = calmed(run, setup, learned)
    found = []
    for name, policy, episodes in (
        ("learned", learned, run.algorithm.iterations * run.algorithm.samples),
        *([("calm", calm.policy, calm.episodes)] if calm else []),
    ):
        done = judge(run, setup, policy)
        labels = {"folder": path.parents[1].name, "case": run.case.name, "seed": run.seed, "policy": name}
        worth = {"episodes": episodes, "robustness": done["robustness_policy"], "successes": done["successes"]}
        found.append(labels | worth | {"trials": trials} | done["outcomes"] | done["motion"])
    return found


def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Learned motions made calm.")
    parser.add_argument("folders", nargs="+", type=Path, help="result folders such as runs/visit_in_order_best")
    parser.add_argument("--batches", type=int, default=100, help="of 20 shortcuts")
    parser.add_argument("--trials", type=int, default=100, help="noisy trials of each policy")
    parser.add_argument("--output", type=Path, help="a CSV file for the full table")
    a = parser.parse_args(arguments)
    table = pd.DataFrame()
    for path in (path for folder in a.folders for path in finished(folder)):
        table = pd.concat([table, pd.DataFrame(rows(path, a.batches, a.trials))], ignore_index=True)
        print(f"{path}: {len(table)} rows", flush=True)
        if a.output:
            table.to_csv(a.output, index=False)
    sums = [name for name in table if name == "trials" or name not in {*MEASURES, "episodes", "robustness", "seed"}]
    by = ["folder", "case", "policy"]
    shown = ["episodes", "robustness", *(name for name in MEASURES if table[name].notna().any())]
    print(table.groupby(by, sort=False)[shown].agg(["min", "median", "max"]).T.unstack().round(4).to_string())
    print(table.groupby(by, sort=False)[[name for name in sums if name not in by]].sum().to_string())


if __name__ == "__main__":
    main(sys.argv[1:])
