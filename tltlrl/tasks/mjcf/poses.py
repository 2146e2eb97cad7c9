"""The joint positions that a page gives: the start, and the waypoints of the reference motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import nearest
from tltlrl.tasks.mjcf import quantities
from tltlrl.tasks.mjcf.evaluation import At
from tltlrl.tasks.mjcf.keys import KINDS, RobotConfig
from tltlrl.tasks.mjcf.model import Told, read_model

Array = NDArray[np.float64]


def start_state(model: mujoco.MjModel, path: Path, config: RobotConfig, at: At) -> tuple[Array, Array]:
    """Positions (nq,) and velocities (nv,) at the start: the keyframe's or the model's, changed by `start`.

    Args:
      model: the model as it is simulated.
      path: path of its MJCF file.
      config: the page.
      at: makes error messages.

    Raises:
      UserError: if there is no such keyframe or joint, or a joint cannot have that position.
    """
    qpos, qvel = np.array(model.qpos0), np.zeros(model.nv)
    if config.keyframe is not None:
        names, told = quantities.names_in(model, "keyframe"), at("keyframe")
        if config.keyframe not in names:
            there = nearest(config.keyframe, names) or quantities.none("keyframe")
            raise told(f"the model has no keyframe {config.keyframe}{there}")
        key = names.index(config.keyframe)
        written = len(read_model(path).keys[key].qpos)
        if written not in (0, model.nq):  # MuJoCo would fill in missing numbers
            raise told(
                f"{config.keyframe} has {written} positions, the model {model.nq}; correct its qpos in the MJCF file"
            )
        qpos, qvel = np.array(model.key_qpos[key]), np.array(model.key_qvel[key])
    for name, value in config.start.items():
        place(model, qpos, name, value, at("start", name))
    return qpos, qvel


def place(model: mujoco.MjModel, qpos: Array, name: str, value: Any, told: Told) -> None:
    """Sets the position of a joint in `qpos` to the page's value.

    Raises:
      UserError: if there is no such joint, or it cannot have that position.
    """
    names = quantities.names_in(model, "joint")
    if name not in names:
        raise told(f"the model has no joint {name}{nearest(name, names)}")
    joint = names.index(name)
    parts = quantities.JOINT_PARTS[int(model.jnt_type[joint])][0]
    values = np.atleast_1d(np.array(value, dtype=float))
    if len(values) != max(len(parts), 1):
        expected = f"{len(parts)} numbers ({', '.join(parts)})" if parts else "one number"
        raise told(f"expected {expected}, not {len(values)}")
    if not np.isfinite(values).all():
        raise told(f"{value} is not finite")
    low, high = model.jnt_range[joint]
    if model.jnt_limited[joint] and not parts and not low <= values[0] <= high:
        raise told(f"{value:g} is out of the joint's range from {low:.6g} to {high:.6g}")
    where = model.jnt_qposadr[joint]
    qpos[where : where + len(values)] = values


def waypoints(model: mujoco.MjModel, start: Array, reference: Any, at: At) -> list[tuple[float, Array]]:
    """Time, s, and positions (nq,) of every waypoint, the start first; the start alone means to stay there.

    Raises:
      UserError: if a waypoint has no time, or a joint cannot have its position.
    """
    points = [(0.0, start)]
    if reference == "hold":
        return points
    if not isinstance(reference, list):
        raise at("reference")(f"expected {KINDS['reference'].kind}, not {reference!r}")
    for i, waypoint in enumerate(reference):
        told = at("reference", str(i))
        if "time" not in waypoint:
            raise told("it has no time; begin it with time: SECONDS")
        time, qpos = float(waypoint["time"]), points[-1][1].copy()
        if not time > points[-1][0] or not math.isfinite(time):
            raise told(f"its time {time:g} s must be after {points[-1][0]:g} s")
        for name, value in waypoint.items():
            if name != "time":
                place(model, qpos, name, value, at("reference", str(i), name))
        points.append((time, qpos))
    return points


def motion_through(
    model: mujoco.MjModel, points: Sequence[tuple[float, Array]], qvel: Array, samples: Array
) -> tuple[Array, Array]:
    """The motion along straight lines between waypoints.

    Args:
      model: the model as it is simulated.
      points: time, s, and positions (nq,) of each waypoint.
      qvel: velocities at the start; the motion keeps them if the start is the only waypoint.
      samples: times of the samples, shape (T,), s, evenly spaced.

    Returns:
      Positions (T, nq) and velocities (T, nv).
    """
    times, path = np.array([time for time, _ in points]), np.array([qpos for _, qpos in points])
    positions = np.stack([np.interp(samples, times, column) for column in path.T], axis=-1)
    velocities = np.zeros((len(samples), model.nv))
    for t in range(len(samples) - 1):
        mujoco.mj_differentiatePos(model, velocities[t], samples[1] - samples[0], positions[t], positions[t + 1])
    if len(times) == 1:
        velocities[0] = qvel
    return positions, velocities
