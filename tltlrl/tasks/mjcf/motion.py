"""Commands that hold a motion: the forces that it needs, divided among the actuators."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def holding_commands(model: mujoco.MjModel, qpos: Array, qvel: Array, still: bool) -> tuple[Array, Array]:
    """The commands that hold a motion, if its accelerations are ignored.

    Without acceleration, the joint forces tau balance gravity, Coriolis forces, springs and dampers; contacts are
    ignored. Let M be the matrix of the actuators' moment arms. The actuators' forces f are the smallest with
    M^T f = tau. An actuator gives f = g u + b, with gain g and with bias b, which depends on its length and velocity.
    So u = (f - b) / g. An actuator with internal dynamics or without gain gets 0. Commands are cut to their range.

    Args:
      model: model of the robot.
      qpos, qvel: states of the motion, shapes (T, nq) and (T, nv).
      still: whether every state is the same as the first.

    Returns:
      Commands of all actuators, shape (T, nu), and the sensors' values at the states, shape (T, nsensordata).
    """
    steps = len(qpos)
    commands, sensors = np.zeros((steps, model.nu)), np.zeros((steps, model.nsensordata))
    data = mujoco.MjData(model)
    for t in range(1 if still else steps):
        data.qpos[:], data.qvel[:] = qpos[t], qvel[t]
        data.ctrl[:] = 0.0
        mujoco.mj_forward(model, data)
        sensors[t] = data.sensordata
        moments = np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(
            moments, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
        force = np.linalg.lstsq(moments.T, data.qfrc_bias - data.qfrc_passive, rcond=None)[0]
        gain, bias = model.actuator_gainprm, model.actuator_biasprm
        length, velocity = data.actuator_length, data.actuator_velocity
        affine = model.actuator_gaintype == mujoco.mjtGain.mjGAIN_AFFINE
        gains = gain[:, 0] + np.where(affine, gain[:, 1] * length + gain[:, 2] * velocity, 0.0)
        biased = model.actuator_biastype == mujoco.mjtBias.mjBIAS_AFFINE
        biases = np.where(biased, bias[:, 0] + bias[:, 1] * length + bias[:, 2] * velocity, 0.0)
        direct = (model.actuator_dyntype == mujoco.mjtDyn.mjDYN_NONE) & (gains != 0)
        wanted = np.where(direct, (force - biases) / np.where(direct, gains, 1.0), 0.0)
        low, high = model.actuator_ctrlrange.T
        commands[t] = np.where(model.actuator_ctrllimited, np.clip(wanted, low, high), wanted)
    if still:
        commands[1:], sensors[1:] = commands[0], sensors[0]
    return commands, sensors
