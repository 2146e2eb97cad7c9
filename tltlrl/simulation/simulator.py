"""Whoever makes trajectories of a task: the batched rollout of its model, or an environment that steps by itself."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tltlrl.simulation.outside import OutsideSimulator
from tltlrl.simulation.rollout import Simulator, Trajectories
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]


class Simulates(Protocol):
    """What training asks for; see `tltlrl.simulation.rollout.Simulator`."""

    @property
    def command_range(self) -> tuple[Array, Array]:
        """The least and the most of each command, shapes (d,)."""

    def draw_command_noise(self, count: int, rng: np.random.Generator) -> Array:
        """What the actuators add to the commands of `count` trajectories, shape (count, T, d)."""

    def draw_starts(self, count: int, rng: np.random.Generator) -> Array | None:
        """What tells the starts of `count` trajectories apart, shape (count, k); None where all start alike."""

    def rollout(self, gain: Array, offsets: Array, command_noise: Array, starts: Array | None = None) -> Trajectories:
        """Simulates u_t = K s_t + offset_t."""


def simulator_of(task: Task) -> Simulates:
    """The one for a task."""
    return Simulator(task) if task.outside is None else OutsideSimulator(task, task.outside)
