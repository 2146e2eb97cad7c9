"""How a motion moves: lengths, accelerations, jerks, commands, and when its verdict is settled.

A spec says what a motion has to achieve; these numbers say whether anybody would run it on a robot.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic import Spec
from tltlrl.simulation.rollout import Simulator, Trajectories
from tltlrl.tasks.task import Signals, Task

Array = NDArray[np.float64]

# Name => what it is and its unit, in the order of the tables.
MEASURES = {
    "path_length": ("path of the end-effector", "m"),
    "acceleration_rms": ("acceleration of the joints, root mean square", "rad/s^2"),
    "acceleration_peak": ("acceleration of the joints, largest", "rad/s^2"),
    "jerk_rms": ("jerk of the joints, root mean square", "rad/s^3"),
    "jerk_peak": ("jerk of the joints, largest", "rad/s^3"),
    "command_rms": ("commands, root mean square of their share of a full one", ""),
    "commands_at_limit": ("share of the commands that are at a limit of their actuator", ""),
    "seconds_to_verdict": ("time to satisfaction: when the verdict is settled", "s"),
}

PREFIXES = 50  # judged at once


def measure(
    task: Task, simulator: Simulator, spec: Spec, motion: Trajectories, trajectory: int = 0
) -> dict[str, float | None]:
    """The measures of one trajectory, by the names in `MEASURES`; None where the task does not say what moves.

    Args:
      task: that was simulated.
      simulator: of it, for the limits of the actuators.
      spec: for the time to the verdict.
      motion: the trajectories.
      trajectory: which of them.
    """
    length = int(motion.lengths[trajectory])
    features, commands = motion.features[trajectory, :length], motion.commands[trajectory, :length]
    of_joints = joint_commands(task)
    low, high = simulator.limits
    signals = task.signals(features[None], commands[None])
    settled = settled_at(spec, signals)
    groups = task.slices
    velocities = None if task.joint_velocities is None else features[:, groups[task.joint_velocities]]
    positions = None if task.end_effector is None else features[:, groups[task.end_effector]]
    return {
        "path_length": None if positions is None else path_length(positions),
        **smoothness(velocities, task.control_timestep),
        "command_rms": rms(commands[:, of_joints] / task.command_scale[of_joints]),
        "commands_at_limit": float(np.mean((commands <= low)[:, of_joints] | (commands >= high)[:, of_joints])),
        "seconds_to_verdict": None if settled is None else settled * task.control_timestep,
    }


def joint_commands(task: Task) -> slice:
    """Where the commands of the joints lie among a task's commands: all of them, unless it says which."""
    start = 0
    for group in task.action:
        if group.name == task.joint_commands:
            return slice(start, start + len(group.parts))
        start += len(group.parts)
    return slice(0, start)


def path_length(positions: Array) -> float:
    """Sum of the distances between consecutive samples, in the unit of `positions`, shape (T, k)."""
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def smoothness(velocities: Array | None, timestep: float) -> dict[str, float | None]:
    """RMS and largest absolute acceleration and jerk, by differences of samples, over all joints and steps.

    Args:
      velocities: shape (T, d), rad/s; None if they are not known.
      timestep: between two samples, s.
    """
    found: dict[str, float | None] = {}
    for order, name in enumerate(("acceleration", "jerk"), start=1):
        values = None
        if velocities is not None and len(velocities) > order:
            values = np.diff(velocities, n=order, axis=0) / timestep**order
        found[f"{name}_rms"] = None if values is None else rms(values)
        found[f"{name}_peak"] = None if values is None else float(np.abs(values).max())
    return found


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def settled_at(spec: Spec, signals: Signals) -> int | None:
    """The sample from which on the trajectory satisfies the spec, wherever after it one stops; None if it violates it.

    The smallest t such that every prefix s_0 .. s_t', t' >= t, of this trajectory has a robustness above 0. So it is
    what this one trajectory does after t that no longer changes the verdict; another continuation still might.

    Args:
      spec: what is judged.
      signals: of one trajectory, shapes (1, T) and (1, T, k).
    """
    values = [np.asarray(signals[name]) for name in spec.signals]
    steps = values[0].shape[1] if values else 0
    for block in range(steps, 0, -PREFIXES):  # from the end, since the last violated prefix decides
        ends = np.arange(max(block - PREFIXES, 0), block) + 1
        repeated = {
            name: np.broadcast_to(value[:, : ends[-1]], (len(ends), ends[-1], *value.shape[2:]))
            for name, value in zip(spec.signals, values, strict=True)
        }
        violated = np.flatnonzero(~(spec.robustness(repeated, ends) > 0))
        if len(violated):
            settled = int(ends[violated[-1]])  # the sample after the violated prefix
            return settled if settled < steps else None
    return 0 if steps else None
