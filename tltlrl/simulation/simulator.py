"""What makes the trajectories of a task: the batched rollout of its model, or an environment that steps by itself."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tltlrl.simulation.outside import OutsideSimulator
from tltlrl.simulation.rollout import Simulator, Trajectories
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]


class Simulates(Protocol):
    """The functions of a simulator that training calls; see `tltlrl.simulation.rollout.Simulator`."""

    @property
    def command_range(self) -> tuple[Array, Array]:
        """The least and the greatest value of each command, shapes (d,)."""

    def draw_command_noise(self, count: int, rng: np.random.Generator) -> Array:
        """The actuators' noise on the commands of `count` trajectories, shape (count, T, d)."""

    def draw_starts(self, count: int, rng: np.random.Generator) -> Array | None:
        """Random starts of `count` trajectories for `rollout`, shape (count, k); None where all start alike."""

    def rollout(self, gain: Array, offsets: Array, command_noise: Array, starts: Array | None = None) -> Trajectories:
        """Simulates the policies u_t = K s_t + offset_t."""


def simulator_of(task: Task) -> Simulates:
    """The simulator of a task."""
    return Simulator(task) if task.outside is None else OutsideSimulator(task, task.outside)
