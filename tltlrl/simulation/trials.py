"""The motion of a policy without noise, and trials with the actuators' noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.simulator import Simulates

Array = NDArray[np.float64]


def mean_motion(simulator: Simulates, policy: Policy) -> Trajectories:
    """Simulates the one trajectory without exploration and without the actuators' noise."""
    offsets = policy.mean[None]
    return simulator.rollout(policy.gain, offsets, np.zeros_like(offsets))


def trials(simulator: Simulates, policy: Policy, count: int, rng: np.random.Generator) -> Trajectories:
    """Simulates the mean policy `count` times, each with the actuators' noise and its own start."""
    offsets = np.broadcast_to(policy.mean, (count, *policy.mean.shape))
    noise = simulator.draw_command_noise(count, rng)
    return simulator.rollout(policy.gain, offsets, noise, simulator.draw_starts(count, rng))


def starts_after_the_first(simulator: Simulates, count: int, rng: np.random.Generator) -> Array | None:
    """Random starts of `count` trajectories after one from the task's own start, shape (1 + count, k).

    None where all start alike.
    """
    starts = simulator.draw_starts(count, rng)
    return None if starts is None else np.concatenate([np.zeros((1, starts.shape[1])), starts])
