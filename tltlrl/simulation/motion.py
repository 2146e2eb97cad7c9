"""Measures of one motion: how far, how jerkily and how hard, and from when on it satisfies its spec.

Accelerations and jerks are first and second differences of the sampled joint velocities, divided by the time between
two samples (for jerks, its square). The last command moves nothing and does not count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic import Spec
from tltlrl.simulation.rollout import Trajectories
from tltlrl.tasks.task import Signals, Task

Array = NDArray[np.float64]

MEASURES = {  # name => unit and meaning, in the order of the tables
    "path_length": "m, of the end-effector",
    "acceleration_rms": "rad/s^2 (of sliding joints m/s^2), over all joints and steps",
    "acceleration_peak": "rad/s^2, of any joint at any step",
    "jerk_rms": "rad/s^3, over all joints and steps",
    "jerk_peak": "rad/s^3, of any joint at any step",
    "command_rms": "of the commands that move joints, as a share of a full one",
    "commands_at_limit": "share of those commands at the actuators' limit or beyond",
    "time_to_satisfaction": "s, from which on every prefix satisfies the spec; empty where the whole does not",
}
SAME = 1e-9  # a command closer than this to its limit, as a share of a full command, is at it
PREFIXES = 64  # evaluated together


def measures(
    task: Task, spec: Spec, motion: Trajectories, command_range: tuple[Array, Array]
) -> dict[str, float | None]:
    """The `MEASURES` of the first trajectory; None where the task does not know its joints or its end-effector.

    Args:
      task: the task that moves; `joint_velocities`, `joint_commands` and `end_effector` say what is measured.
      spec: the spec of the time to satisfaction.
      motion: trajectories; samples after an early end do not count.
      command_range: the least and the greatest value of each command, shapes (d,).
    """
    length, timestep = int(motion.lengths[0]), task.control_timestep
    features, commands = motion.features[0, :length], motion.commands[0, : length - 1]
    found: dict[str, float | None] = dict.fromkeys(MEASURES)
    if task.end_effector is not None:
        found["path_length"] = path_length(features[:, task.slices[task.end_effector]])
    if task.joint_velocities is not None:
        found |= smoothness(features[:, task.joint_velocities], timestep)
    moved = task.joint_commands
    low, high = (limit[moved] for limit in command_range)
    found |= effort(commands[:, moved], task.command_scale[moved], low, high)
    signals = task.signals(motion.features[:1], motion.commands[:1])
    step = satisfied_from(spec, signals, length)
    found["time_to_satisfaction"] = None if step is None else step * timestep
    return found


def path_length(positions: Array) -> float:
    """Length of the polyline through positions, shape (T, k)."""
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def smoothness(velocities: Array, timestep: float) -> dict[str, float | None]:
    """RMS and peak of accelerations and jerks; None where a motion is too short.

    Args:
      velocities: joint velocities, shape (T, j), rad/s.
      timestep: between two samples, s.
    """
    acceleration = np.diff(velocities, axis=0) / timestep
    jerk = np.diff(acceleration, axis=0) / timestep
    return {
        "acceleration_rms": _rms(acceleration),
        "acceleration_peak": _peak(acceleration),
        "jerk_rms": _rms(jerk),
        "jerk_peak": _peak(jerk),
    }


def effort(commands: Array, scale: Array, low: Array, high: Array) -> dict[str, float | None]:
    """RMS of commands as shares of a full command, and the share of commands at a limit.

    Args:
      commands: shape (T, j), as the policy sent them.
      scale: the size of a full command, shape (j,).
      low, high: the actuators' limits, shapes (j,); infinite where there is none.
    """
    at_limit = (commands <= low + SAME * scale) | (commands >= high - SAME * scale)
    return {
        "command_rms": _rms(commands / scale),
        "commands_at_limit": float(np.mean(at_limit)) if at_limit.size else None,
    }


def satisfied_from(spec: Spec, signals: Signals, length: int) -> int | None:
    """The smallest t such that every prefix s_0 .. s_t', t <= t' < length, satisfies the spec; None if there is none.

    Args:
      spec: satisfied where its robustness is above 0.
      signals: of one trajectory, shapes (1, T) and (1, T, k).
      length: its samples that count.
    """
    first = length
    while first > 0:  # backwards, because the last prefixes decide
        lengths = np.arange(max(first - PREFIXES, 0) + 1, first + 1)
        end = lengths[-1]
        prefixes = {name: np.repeat(values[:, :end], len(lengths), axis=0) for name, values in signals.items()}
        violated = np.flatnonzero(~(spec.robustness(prefixes, lengths) > 0))
        if len(violated):
            first = int(lengths[violated[-1]])
            break
        first = int(lengths[0]) - 1
    return None if first == length else first


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def _peak(values: Array) -> float | None:
    return float(np.abs(values).max()) if values.size else None
