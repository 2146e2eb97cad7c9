"""A task's model, ready to be stepped in batches."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import mujoco.rollout
import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]
HUGE = mujoco.mjMAXVAL  # larger positions and velocities MuJoCo would reset, larger controls it would ignore
ROUNDING = 1e-6  # allowed in a quotient of times
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
HELPS = "a smaller timestep of the model, more damping or armature in its joints"  # against divergence
mujoco.set_mju_user_warning(lambda _: None)  # `rollout` raises instead; MuJoCo would leave a file where the user works


@dataclass(frozen=True)
class Scene:
    """A compiled model with what stepping it in batches needs. Threads must not share it.

    Attributes:
      model: changes to it hold from the next step on.
      data: where it is stepped.
      rollout: without a thread pool, which costs more time than it saves at the usual sizes of a batch.
      substeps: physics steps in one control step.
      start: the full physics state at the task's start, shape (size,).
      of_forces: which sensor values measure forces and accelerations, shape (nsensordata,).
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    rollout: mujoco.rollout.Rollout
    substeps: int
    start: Array
    of_forces: NDArray[np.bool_]

    def sensors_at(self, states: Array) -> Array:
        """The sensors' values at full physics states (N, size), without a command: (N, nsensordata)."""
        values = np.empty((len(states), self.model.nsensordata))
        for row, state in zip(values, states, strict=True):
            mujoco.mj_setState(self.model, self.data, state, STATE)
            self.data.ctrl[:], self.data.qacc_warmstart[:] = 0.0, 0.0
            mujoco.mj_forward(self.model, self.data)
            row[:] = self.data.sensordata
        return values

    def starting_states(self, count: int, pushes: Array | None) -> Array:
        """The full physics states at s_0, (count, size): the task's start, with the first M moved away from it.

        Args:
          count: number of states.
          pushes: how far the first M are from the start, shape (M, nv), rad or m.
        """
        states, nq = np.tile(self.start, (count, 1)), self.model.nq
        for state, push in zip(states, () if pushes is None else pushes, strict=False):
            qpos = state[1 : 1 + nq].copy()
            mujoco.mj_integratePos(self.model, qpos, push, 1.0)
            state[1 : 1 + nq] = qpos
        return states


def scene_of(task: Task) -> Scene:
    """Compiles a task's model.

    Raises:
      UserError: if a control step is no whole number of physics steps.
    """
    physics = task.make_physics()
    model = physics.model.ptr
    count = substeps(task, model.opt.timestep)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # so that divergence can be seen
    data, start = mujoco.MjData(model), np.empty(mujoco.mj_stateSize(model, STATE))
    data.qpos[:], data.qvel[:] = task.initial_state()
    mujoco.mj_getState(model, data, start, STATE)
    of_forces = np.repeat(model.sensor_needstage == mujoco.mjtStage.mjSTAGE_ACC.value, model.sensor_dim)
    return Scene(model, data, mujoco.rollout.Rollout(nthread=0), count, start, of_forces)


def substeps(task: Task, timestep: float) -> int:
    """The number of physics steps, of `timestep` seconds each, in one control step.

    Raises:
      UserError: if it is not a whole number.
    """
    quotient = task.control_timestep / timestep
    count = round(quotient)
    if count < 1 or abs(quotient - count) > ROUNDING:
        raise UserError(
            f"the control timestep of {task.control_timestep} s is no multiple of the model's, {timestep} s; change "
            "one of them"
        )
    return count
