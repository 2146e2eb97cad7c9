"""Steps N copies of a task's robot together, for environments that send one command at a time.

Each copy moves exactly as in `tltlrl.simulation.rollout`, to the last bit, whatever the others do.
"""

from __future__ import annotations

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from tltlrl.simulation.rollout import of_forces, sensors_at, starting_states
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]


class Stepper:
    """N robots of one task.

    Attributes:
      features: features of the current sample, (N, n).
    """

    def __init__(self, task: Task, count: int) -> None:
        self._task = task
        self._physics = task.make_physics()
        self._model = self._physics.model.ptr
        self._data = mujoco.MjData(self._model)
        self._rollout = mujoco.rollout.Rollout(nthread=0)
        self._substeps = round(task.control_timestep / self._model.opt.timestep)
        self._data.qpos[:], self._data.qvel[:] = task.initial_state()
        self._start = np.empty(mujoco.mj_stateSize(self._model, mujoco.mjtState.mjSTATE_FULLPHYSICS.value))
        mujoco.mj_getState(self._model, self._data, self._start, mujoco.mjtState.mjSTATE_FULLPHYSICS.value)
        self._state = np.tile(self._start, (count, 1))
        self._of_forces = of_forces(self._model)
        self._forces = sensors_at(self._model, self._data, self._state)
        self.features = self._features()

    def restart(self, row: int, push: Array | None = None) -> None:
        """Puts one robot at its start, or away from it by `push`, shape (1, nv), rad or m."""
        state = starting_states(self._model, self._start, 1, push)
        self._state[row] = state[0]
        self._forces[row] = sensors_at(self._model, self._data, state)[0]
        self.features = self._features()

    def step(self, commands: Array) -> None:
        """Simulates one control step.

        Args:
          commands: what reaches the actuators, (N, d), in the commands' unit.
        """
        count = len(self._state)
        control = np.repeat(commands[:, None], self._substeps, axis=1)
        states = np.empty((count, self._substeps, self._start.size))
        sensors = np.empty((count, self._substeps, self._model.nsensordata))
        self._rollout.rollout(
            [self._model] * count,
            [self._data],
            self._state,
            control,
            nstep=self._substeps,
            skip_checks=True,
            state=states,
            sensordata=sensors,
        )
        self._state, self._forces = states[:, -1].copy(), sensors[:, -1].copy()
        self.features = self._features()

    def _features(self) -> Array:
        nq, nv = self._model.nq, self._model.nv
        features = self._task.features(self._state[:, 1 : 1 + nq], self._state[:, 1 + nq : 1 + nq + nv])
        if self._task.sensed is None:
            return features
        values = sensors_at(self._model, self._data, self._state)
        return np.concatenate([features, self._task.sensed(np.where(self._of_forces, self._forces, values))], axis=1)
