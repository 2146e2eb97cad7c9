"""What a policy is worth: the robustness of its noise-free motion, and of trials with the actuators' noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.simulator import Simulates

Array = NDArray[np.float64]


def mean_motion(simulator: Simulates, policy: Policy) -> Trajectories:
    """The one trajectory without exploration and without command noise."""
    offsets = policy.mean[None]
    return simulator.rollout(policy.gain, offsets, np.zeros_like(offsets))


def trials(simulator: Simulates, policy: Policy, count: int, rng: np.random.Generator) -> Trajectories:
    """`count` trajectories of the mean policy, each disturbed by the actuators' noise, from a start of its own."""
    offsets = np.broadcast_to(policy.mean, (count, *policy.mean.shape))
    noise = simulator.draw_command_noise(count, rng)
    return simulator.rollout(policy.gain, offsets, noise, simulator.draw_starts(count, rng))
