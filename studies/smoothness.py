"""How smoothly learned policies move the arm, and what that costs: accelerations, command changes, successes.

Measured for every finished run of the given result folders: the noise-free mean policy in the training scene, and the
noisy trials that summary.csv counts (the same draws, in the evaluation scene). Accelerations are finite differences
of the joint velocities from one 20 Hz sample to the next, changes of command those of the joints' commanded speeds
(without the gripper's). The robustness is that of each folder's spec. The policy at the start is measured, too.

    python -m studies.smoothness runs/toast runs/toast_smooth --output smoothness.csv
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tltlrl.experiments.results import open_run
from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.store.layout import DONE
from tltlrl.tasks.task import Signals
from tltlrl.training.build import make_task
from tltlrl.training.start import first_policy
from tltlrl.training.study import Run
from tltlrl.training.verdict import try_policy

Array = NDArray[np.float64]


def movement(signals: Signals, lengths: NDArray[np.int64], timestep: float) -> dict[str, float]:
    """Size of accelerations and command changes over all joints and steps of some trajectories.

    Args:
      signals: with `velocities` (N, T, d) and `command` (N, T, d or more), rad/s, the joints first.
      lengths: samples of each trajectory that count, shape (N,).
      timestep: between two samples, s.

    Returns:
      Root mean square (`_rms`) and, of accelerations and commands, the largest absolute value (`_peak`); rad/s^2 for
      accelerations, rad/s for commands.
    """
    velocities = [v[:length] for v, length in zip(signals["velocities"], lengths, strict=True)]
    joints = velocities[0].shape[1]
    commands = [c[:length, :joints] for c, length in zip(signals["command"], lengths, strict=True)]
    accelerations = _steps(velocities) / timestep
    return {
        "acceleration_rms": _rms(accelerations),
        "acceleration_peak": float(np.abs(accelerations).max()),
        "command_change_rms": _rms(_steps(commands)),
        "command_peak": float(np.abs(np.concatenate(commands)).max()),
    }


def _steps(trajectories: Sequence[Array]) -> Array:
    return np.concatenate([np.diff(trajectory, axis=0) for trajectory in trajectories])


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def measure(run: Run, policy: Policy, specs: Mapping[str, Spec]) -> dict[str, float]:
    """What one policy does.

    Args:
      run: the policy's own.
      policy: learned or at the start.
      specs: by the name that their columns get.

    Returns:
      Columns `mean_*` of its noise-free motion and `trial_*` of its noisy trials; `mean_<spec>`, the robustness of the
      former; `trials_*`, the number of trials that satisfied each spec and had each of the task's own outcomes.
    """
    task = make_task(run.task)
    motion = mean_motion(Simulator(task), policy)
    signals = task.signals(motion.features, motion.commands)
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials])
    tried = try_policy(run, policy, run.trials, rng)
    row = {f"mean_{name}": value for name, value in movement(signals, motion.lengths, task.control_timestep).items()}
    row |= {
        f"trial_{name}": value for name, value in movement(tried.signals, tried.lengths, task.control_timestep).items()
    }
    for name, spec in specs.items():
        row[f"mean_{name}"] = float(spec.robustness(signals, motion.lengths)[0])
        row[f"trials_{name}"] = int(np.sum(spec.robustness(tried.signals, tried.lengths) > 0))
    return row | {f"trials_{name}": int(np.sum(values)) for name, values in tried.outcomes.items()}


def table(folders: Sequence[Path]) -> pd.DataFrame:
    """One row per run, and one per folder and case for the policy that its runs start from (seed -1)."""
    opened = [(path, *open_run(path)) for folder in folders for path in finished(folder)]
    specs = {path.parents[1].name: run.spec for path, run, _ in opened}
    rows, started = [], set()
    for path, run, policy in opened:
        labels = {"folder": path.parents[1].name, "case": run.case.name}
        if path.parent not in started:
            started.add(path.parent)
            start = first_policy(make_task(run.task), run.algorithm)
            rows.append(labels | {"seed": -1, "trials": run.trials} | measure(run, start, specs))
        rows.append(labels | {"seed": run.seed, "trials": run.trials} | measure(run, policy, specs))
    return pd.DataFrame(rows)


def finished(folder: Path) -> Iterator[Path]:
    """The finished runs of a result folder, by case and seed."""
    paths = (path.parent for path in folder.glob(f"*/seed_*/{DONE}"))
    return iter(sorted(paths, key=lambda path: (path.parent.name, int(path.name.removeprefix("seed_")))))


def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Smoothness of learned policies.")
    parser.add_argument("folders", nargs="+", type=Path, help="result folders such as runs/toast")
    parser.add_argument("--output", type=Path, help="a CSV file for the full table")
    a = parser.parse_args(arguments)
    results = table(a.folders)
    if a.output:
        results.to_csv(a.output, index=False)
    start = results["seed"] == -1
    by_case = ["folder", "case"]
    for title, part in (("policy at the start", results[start]), ("learned policies", results[~start])):
        groups = part.drop(columns=["seed", "trials"]).groupby(by_case)
        print(f"\n{title}: least, median and greatest over the seeds")
        print(groups.agg(["min", "median", "max"]).T.unstack().round(4).to_string())
        print(part.groupby(by_case)[[c for c in part if c.startswith("trials")]].sum().to_string(), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
