"""The draws of an iteration: offsets, noise and starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.learner import Learner
from tltlrl.learning.policy import Policy
from tltlrl.simulation.simulator import Simulates
from tltlrl.training.study import Run

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Samples:
    """The draws for the simulations of one iteration.

    Attributes:
      policy: the policy that the offsets were drawn from.
      offsets: offsets of the N samples and, last, of the mean policy, shape (N + 1, T, d).
      noise: the actuators' noise, shape (N + 1, T, d); 0 for the mean policy.
      starts: how far the N samples start from the task's start, shape (N, nv); None where all start there.
    """

    policy: Policy
    offsets: Array
    noise: Array
    starts: Array | None


def draw(run: Run, learner: Learner[Any], simulator: Simulates, state: Any, iteration: int) -> Samples:
    """Draws the samples of an iteration. They depend only on its number, the seed and the learner's state."""
    rng = np.random.default_rng([run.seed, iteration])
    policy = learner.policy(state)
    offsets = np.concatenate([learner.ask(state, run.algorithm.samples, rng), policy.mean[None]])
    noise = np.concatenate(
        [simulator.draw_command_noise(run.algorithm.samples, rng), np.zeros((1, *policy.mean.shape))]
    )
    return Samples(policy, offsets, noise, simulator.draw_starts(run.algorithm.samples, rng))
