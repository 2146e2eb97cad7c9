"""Steps N copies of a task's robot together, for environments that send one command at a time.

Each copy moves exactly as in `tltlrl.simulation.rollout`, to the last bit, whatever the others do.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.simulation.scene import HELPS, HUGE, ROUNDING, scene_of
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]


class Stepper:
    """N robots of one task.

    Attributes:
      features: features of the current sample, (N, n).
    """

    def __init__(self, task: Task, count: int) -> None:
        self._task, self._scene = task, scene_of(task)
        self._state = self._scene.starting_states(count, None)
        self._forces = self._scene.sensors_at(self._state)
        self.features = self._features()

    def restart(self, row: int, push: Array | None = None) -> None:
        """Puts one robot at its start, or away from it by `push`, shape (1, nv), rad or m."""
        state = self._scene.starting_states(1, push)
        self._state[row] = state[0]
        self._forces[row] = self._scene.sensors_at(state)[0]
        self.features = self._features()

    def step(self, commands: Array) -> None:
        """Simulates one control step.

        Args:
          commands: what reaches the actuators, (N, d), in the commands' unit.

        Raises:
          FloatingPointError: if a simulation diverged, naming the first that did.
        """
        scene, count = self._scene, len(self._state)
        states = np.empty((count, scene.substeps, scene.start.size))
        sensors = np.empty((count, scene.substeps, scene.model.nsensordata))
        scene.rollout.rollout(
            [scene.model] * count,
            [scene.data],
            self._state,
            np.repeat(commands[:, None], scene.substeps, axis=1),
            nstep=scene.substeps,
            skip_checks=True,
            state=states,
            sensordata=sensors,
        )
        seconds = self._state[:, 0] + self._task.control_timestep
        late = np.abs(states[:, -1, 0] - seconds) > ROUNDING  # the rest of a step in which something went wrong is left
        wrong = np.flatnonzero(late | ~(np.abs(states[:, -1]) < HUGE).all(axis=1))
        if len(wrong):
            raise FloatingPointError(
                f"the simulation of {self._task.name} diverged: environment {wrong[0]}, {seconds[wrong[0]]:.3g} s; "
                f"{HELPS}, or smaller actions usually help"
            )
        self._state, self._forces = states[:, -1].copy(), sensors[:, -1].copy()
        self.features = self._features()

    def _features(self) -> Array:
        nq, nv = self._scene.model.nq, self._scene.model.nv
        features = self._task.features(self._state[:, 1 : 1 + nq], self._state[:, 1 + nq : 1 + nq + nv])
        if self._task.sensed is None:
            return features
        values = self._scene.sensors_at(self._state)
        sensed = self._task.sensed(np.where(self._scene.of_forces, self._forces, values))
        return np.concatenate([features, sensed], axis=1)
