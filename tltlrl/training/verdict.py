"""Judges a learned policy: by the robustness of its mean motion, and by trials with the actuators' noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.logic import reasons
from tltlrl.simulation.motion import measures
from tltlrl.simulation.perturb import Perturbation, perturbed_trials
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.simulator import simulator_of
from tltlrl.simulation.trials import mean_motion, starts_after_the_first, trials
from tltlrl.tasks.task import Signals, Task
from tltlrl.training.build import Setup, make_evaluation_task, make_task
from tltlrl.training.study import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trials:
    """Trials of a learned policy, in the evaluation scene, with the actuators' noise.

    Attributes:
      robustness: robustness of each trial, shape (count,).
      outcomes: what the task itself judges, without the spec: name => whether it holds, shape (count,).
      signals, lengths: signals and samples of the trials, for explanations.
    """

    robustness: Array
    outcomes: dict[str, NDArray[np.bool_]]
    signals: Signals
    lengths: NDArray[np.int64]


def try_policy(run: Run, policy: Policy, count: int, rng: np.random.Generator) -> Trials:
    """Makes `count` trials of the mean policy."""
    task = make_evaluation_task(run.task)
    return _judged(run, task, trials(simulator_of(task), policy, count, rng))


def try_off_model(
    run: Run, policy: Policy, perturbation: Perturbation, size: float, count: int, rng: np.random.Generator
) -> tuple[Trials | None, int]:
    """Makes `count` trials of the mean policy, each with a changed model; see `perturbed_trials`.

    Returns:
      The trials whose simulation did not diverge, if any, and how many did.
    """
    task = make_evaluation_task(run.task)
    motion, diverged = perturbed_trials(task, policy, perturbation, size, count, rng)
    return (None if motion is None else _judged(run, task, motion)), diverged


def _judged(run: Run, task: Task, motion: Trajectories) -> Trials:
    signals = task.signals(motion.features, motion.commands)
    robustness = run.spec.robustness(signals, motion.lengths)
    return Trials(robustness, task.outcomes(motion.last_qpos, motion.last_qvel), signals, motion.lengths)


@dataclass(frozen=True)
class Motions:
    """Motions of a policy in the scene of training.

    Attributes:
      signals: name => (N, T) or (N, T, k).
      lengths: samples of each motion, shape (N,).
      robustness: robustness of each motion, shape (N,).
    """

    signals: Signals
    lengths: NDArray[np.int64]
    robustness: Array


def motions(run: Run, policy: Policy, samples: int, rng: np.random.Generator) -> Motions:
    """The mean motion without noise, then `samples` motions with exploration and the actuators' noise."""
    task = make_task(run.task)
    simulator = simulator_of(task)
    offsets = np.concatenate([policy.mean[None], policy.sample(samples, rng)])
    noise = np.concatenate([np.zeros((1, *policy.mean.shape)), simulator.draw_command_noise(samples, rng)])
    moved = simulator.rollout(policy.gain, offsets, noise, starts_after_the_first(simulator, samples, rng))
    signals = task.signals(moved.features, moved.commands)
    return Motions(signals, moved.lengths, run.spec.robustness(signals, moved.lengths))


def robustness_of(run: Run, setup: Setup, policy: Policy) -> float:
    """The robustness of the mean motion of a policy."""
    motion = mean_motion(setup.simulator, policy)
    return float(run.spec.robustness(setup.task.signals(motion.features, motion.commands), motion.lengths)[0])


def judge(run: Run, setup: Setup, policy: Policy) -> dict[str, Any]:
    """The content of done.json, as plain data."""
    motion = mean_motion(setup.simulator, policy)
    why = run.spec.explain(setup.task.signals(motion.features, motion.commands), motion.lengths)
    of_policy = why[0].value
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials])
    tried = try_policy(run, policy, run.trials, rng)
    return {
        "iterations": run.algorithm.iterations,
        "robustness_policy": of_policy,
        "satisfied": of_policy > 0,
        "trials": run.trials,
        "successes": int(np.sum(tried.robustness > 0)),
        "motion": measures(setup.task, run.spec, motion, setup.simulator.command_range),
        "outcomes": {name: int(np.sum(values)) for name, values in tried.outcomes.items()},
        "why_policy_fails": reasons.to_json(reasons.failed(why)),
        "why_trials_fail": reasons.to_json(reasons.failed(run.spec.explain(tried.signals, tried.lengths))),
    }
