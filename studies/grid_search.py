"""Grid search for the coefficients of the hand-made rewards, as in the case study; run by `make grid-search`.

Only ratios matter, since returns are normalised: the first coefficient stays fixed. Episode-based and step-based REPS
are searched apart, on seeds that no reported experiment uses. Every point of the grid is trained at the full budget:
of the planar tasks in the kinematic model of their arm (see studies.lockstep), then the best ones of the continuous
reward again in MuJoCo; of the toast task in MuJoCo at once, then the best ones again with more seeds. Of the discrete
reward it is only asked whether its relative sizes matter. A point is judged by the spec's robustness of the final mean
policy, averaged over the seeds. The full table goes to studies/grid_search_<task>.csv.

    python -m studies.grid_search reach_avoid visit_in_order toast
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from studies.lockstep import Kinematic, Learner, train
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.learning.reps import fit
from tltlrl.registry import LEARNERS
from tltlrl.simulation.rollout import Simulator
from tltlrl.training.build import make_reward, make_task
from tltlrl.training.start import first_policy
from tltlrl.training.study import Run

STUDIES = Path(__file__).parent
SEEDS = (100, 101, 102, 103)
MORE_SEEDS = tuple(range(104, 116))  # of the finalists of a task whose points differ less than its seeds
FINALISTS = {"reach_avoid": 2, "visit_in_order": 2, "toast": 4}
BATCH = 8  # runs simulated at once: more fall out of the cache
Coefficients = dict[str, float]

# By task and reward; the coefficients that are not named keep the value of configs/reward.
GRIDS: dict[tuple[str, str], dict[str, Sequence[float]]] = {
    ("reach_avoid", "continuous"): {"c2": (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)},
    ("reach_avoid", "discrete"): {"obstacle": (-0.5, -2.0, -20.0)},
    ("visit_in_order", "continuous"): {"c2": (0.0, 0.05, 0.1, 0.2, 0.4), "c3": (0.0, 0.05, 0.1, 0.2)},
    ("visit_in_order", "discrete"): {"obstacle": (-0.2, -2.0), "wrong_order": (-1.0, -5.0)},
    ("toast", "continuous"): {
        "c2": (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0, 1.1, 1.2, 1.4, 1.7, 2.2),
        "c3": (0.001, 0.01, 0.1),
    },
}
EPISODE_BASED_ONLY = {"toast"}  # as in the case study
WITHOUT_KINEMATIC_MODEL = {"toast"}


def points(task: str, reward: str) -> list[Coefficients]:
    """Every point of a grid."""
    grid = GRIDS[task, reward]
    return [dict(zip(grid, values, strict=True)) for values in itertools.product(*grid.values())]


def search(
    task: str, case: str, grid: Sequence[Coefficients], seeds: Sequence[int], kinematic: bool, iterations: int | None
) -> pd.DataFrame:
    """Trains a case with every point and seed; one row each."""
    jobs = [(point, seed) for point in grid for seed in seeds]
    batches = [jobs[i : i + BATCH] for i in range(0, len(jobs), BATCH)]
    return pd.concat([_train(task, case, batch, kinematic, iterations) for batch in batches], ignore_index=True)


def _train(
    task_name: str, case: str, jobs: Sequence[tuple[Coefficients, int]], kinematic: bool, iterations: int | None
) -> pd.DataFrame:
    study, _ = read(compose([f"experiment={task_name}", f"cases=[{case}]"]))
    base = study.runs()[0]
    a, own = base.algorithm, base.learner
    iterations = iterations or a.iterations
    learners = [
        Learner(
            seed,
            functools.partial(fit, rule=own.covariance, kept=own.kept),
            own.epsilon,
            make_reward(_with(base, point)),
            LEARNERS.get(base.case.learner).by_step,
        )
        for point, seed in jobs
    ]
    task = make_task(base.task)
    simulator = Kinematic(task) if kinematic else Simulator(task)
    curves = train(task, base.spec, simulator, first_policy(task, a), learners, a.samples, iterations)
    satisfied = curves.policy > 0
    return pd.DataFrame(
        {
            "task": task_name,
            "physics": "kinematic" if kinematic else "mujoco",
            "case": case,
            **{key: [point[key] for point, _ in jobs] for key in jobs[0][0]},
            "seed": [seed for _, seed in jobs],
            "iterations": iterations,
            "robustness_policy": curves.final.round(4),
            "satisfied_policies": satisfied.mean(axis=0).round(3),
            "robustness_mean_over_run": curves.samples.mean(axis=0).round(4),
        }
    )


def _with(run: Run, point: Coefficients) -> Run:
    """The run with these coefficients, for step-based REPS, too."""
    changed: dict[str, Any] = point | {"step": {}}
    return dataclasses.replace(run, reward=dataclasses.replace(run.reward, **changed))


def ranking(results: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """The points of one case, best first, averaged over the seeds."""
    scores = ["robustness_policy", "robustness_mean_over_run"]
    return results.groupby(list(keys))[scores].mean().sort_values("robustness_policy", ascending=False)


def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Grid search for the coefficients of the hand-made rewards.")
    parser.add_argument("tasks", nargs="+", choices=sorted({task for task, _ in GRIDS}))
    parser.add_argument("--rewards", nargs="+", default=["continuous", "discrete"])
    parser.add_argument("--iterations", type=int, help="fewer than the experiment's, for a trial")
    parser.add_argument("--finalists", type=int, help="points trained again")
    parser.add_argument("--seeds", nargs="+", type=int, default=SEEDS)
    parser.add_argument("--output", type=Path, default=STUDIES)
    a = parser.parse_args(arguments)
    for task in a.tasks:
        tables = []
        kinematic = task not in WITHOUT_KINEMATIC_MODEL
        rewards = [reward for reward in a.rewards if (task, reward) in GRIDS]
        algorithms = ("episodic",) if task in EPISODE_BASED_ONLY else ("episodic", "step")
        for reward, algorithm in itertools.product(rewards, algorithms):
            case, grid, keys = f"{reward}_{algorithm}", points(task, reward), list(GRIDS[task, reward])
            tables.append(search(task, case, grid, a.seeds, kinematic, a.iterations))
            best = ranking(tables[-1], keys)
            print(f"\n{task} {case}, {'kinematic' if kinematic else 'MuJoCo'}\n{best}", flush=True)
            count = FINALISTS[task] if a.finalists is None else a.finalists
            if reward == "continuous" and count:
                finalists = [dict(zip(keys, point, strict=True)) for point in best.index.to_frame().head(count).values]
                seeds = a.seeds if kinematic else MORE_SEEDS
                tables.append(search(task, case, finalists, seeds, False, a.iterations))
                print(f"\n{task} {case}, MuJoCo, seeds {seeds}\n{ranking(tables[-1], keys)}", flush=True)
            a.output.mkdir(exist_ok=True)
            pd.concat(tables).to_csv(a.output / f"grid_search_{task}.csv", index=False)


if __name__ == "__main__":
    main(sys.argv[1:])
