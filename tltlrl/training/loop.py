"""One iteration: sample, score, tell, record.

The noise of iteration i comes from a generator seeded with (seed, i). So a run that was interrupted ends in the same
bytes as one that was not, and cases with the same seed share their noise (common random numbers).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.scores import Scores
from tltlrl.logic import telescope
from tltlrl.tasks.task import Signals, StepReward
from tltlrl.training.build import Setup
from tltlrl.training.clauses import standing
from tltlrl.training.draw import draw
from tltlrl.training.study import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Iteration:
    """The outcome of one iteration.

    Attributes:
      state: the learner's state after it.
      record: the columns of progress.csv that depend on the iteration alone; the learner's own come last.
      clauses: the columns of clauses.csv.
      env_steps: samples of its trajectories; samples after an early end do not count.
      physics_seconds: time spent in simulation, s.
    """

    state: Any
    record: dict[str, float]
    clauses: dict[str, str]
    env_steps: int
    physics_seconds: float


def iterate(run: Run, setup: Setup, state: Any, iteration: int) -> Iteration:
    """Does one iteration: N sampled trajectories and, in the same batch, one of the mean policy without noise.

    Raises:
      ValueError: if a return is not a number that can be learned from.
      FloatingPointError: if the simulation diverged.
    """
    samples, drawn = run.algorithm.samples, draw(run, setup.learner, setup.simulator, state, iteration)
    start = time.perf_counter()
    trajectories = setup.simulator.rollout(drawn.policy.gain, drawn.offsets, drawn.noise, drawn.starts)
    physics_seconds = time.perf_counter() - start

    signals = setup.task.signals(trajectories.features, trajectories.commands)
    parts = run.spec.parts(signals, trajectories.lengths)
    robustness = parts.robustness
    sampled, of_policy = robustness[:samples], robustness[samples]
    sample_signals = {name: values[:samples] for name, values in signals.items()}
    told = sampled if setup.returns is None else setup.returns(sample_signals, trajectories.lengths[:samples])
    rewards = None
    if setup.reward is None and setup.learner.by_step:
        rewards = telescope(setup.told, sample_signals, trajectories.lengths[:samples])
    scores = score(setup.reward, sample_signals, told, rewards)
    following, diagnostics = setup.learner.tell(state, drawn.offsets[:samples], scores)
    record = {
        "return_mean": scores.returns.mean(),
        "robustness_mean": sampled.mean(),
        "robustness_std": sampled.std(),
        "robustness_min": sampled.min(),
        "robustness_max": sampled.max(),
        "robustness_policy": of_policy,
        "satisfied_fraction": np.mean(sampled > 0),
    } | diagnostics
    env_steps = int(trajectories.lengths[:samples].sum())
    numbers = {name: float(value) for name, value in record.items()}
    return Iteration(following, numbers, standing(parts.of_first(samples)), env_steps, physics_seconds)


def score(reward: StepReward | None, signals: Signals, told: Array, telescoped: Array | None = None) -> Scores:
    """The scores that the learner is told, in the reward's own units.

    After an early end the last sample's hand-made reward repeats (an absorbing state). Otherwise an episode could
    avoid costs by ending early.

    Args:
      reward: the hand-made reward; None to learn from the spec.
      signals: signals of the sampled trajectories, shapes (N, T) and (N, T, k).
      told: their returns under the spec, shape (N,).
      telescoped: the same as rewards per step, shape (N, T), for learners that need them.
    """
    if reward is None:
        return Scores(told, telescoped)
    rewards, _ = reward(signals)
    return Scores(rewards.sum(axis=1), rewards)
