"""The actuators of a page: which it adds to the model, which are commanded, and their feedback."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import nearest
from tltlrl.tasks.mjcf import quantities
from tltlrl.tasks.mjcf.evaluation import At
from tltlrl.tasks.mjcf.model import Told

Array = NDArray[np.float64]
OF_JOINT = (mujoco.mjtTrn.mjTRN_JOINT.value, mujoco.mjtTrn.mjTRN_JOINTINPARENT.value)
SINGLE = (mujoco.mjtJoint.mjJNT_HINGE.value, mujoco.mjtJoint.mjJNT_SLIDE.value)
MOTOR, POSITION, VELOCITY, DAMPING, RANGE, FORCE = "motor", "position", "velocity", "damping", "range", "force"
BEYOND = 20.0  # a radian is 57 degrees
PARTS = (MOTOR, POSITION, VELOCITY, DAMPING, RANGE, FORCE)


@dataclass(frozen=True)
class Added:
    """An actuator that a page adds to the model, named like its joint.

    Attributes:
      joint: the joint that it drives.
      kind: motor, position or velocity, as in MJCF.
      gain: gear of a motor, kp of a position actuator, kv of a velocity actuator.
      damping: kv of a position actuator.
      low, high: range of its commands.
      force: its greatest force, N or N m; None for no limit.
    """

    joint: str
    kind: str
    gain: float
    damping: float
    low: float
    high: float
    force: float | None


def added_to(actuators: Mapping[str, Any], at: At) -> tuple[Added, ...]:
    """The actuators in the page's `actuators`.

    Args:
      actuators: joint => {motor|position|velocity: gain, range: ..., damping: ..., force: ...}.
      at: makes error messages.

    Raises:
      UserError: if the description of one is not complete.
    """
    return tuple(_added(joint, parts, at("actuators", joint)) for joint, parts in actuators.items())


def _added(joint: str, parts: Any, told: Told) -> Added:
    for part in parts:
        if part not in PARTS:
            raise told(f"an actuator has no {part}{nearest(part, PARTS)}")
    kinds = [kind for kind in (MOTOR, POSITION, VELOCITY) if kind in parts]
    if len(kinds) != 1:
        raise told(f"it is {' and '.join(kinds) or 'no kind of actuator'}; give one of motor, position and velocity")
    (kind,) = kinds
    if RANGE not in parts:
        raise told("it has no range, so nobody knows what a full command is; add range: [LOW, HIGH]")
    low, high = _span(parts[RANGE], told)
    if DAMPING in parts and kind != POSITION:
        raise told("damping belongs to an actuator of the kind position; leave it out")
    numbers = [parts[name] for name in (kind, DAMPING, FORCE) if name in parts]
    if any(isinstance(number, list) or not 0 < number < math.inf for number in numbers):
        raise told("gain, damping and force must be single numbers above 0")
    return Added(joint, kind, float(parts[kind]), float(parts.get(DAMPING, 0.0)), low, high, parts.get(FORCE))


def _span(value: Any, told: Told) -> tuple[float, float]:
    """The range that a page gives: two numbers, or `0.5` for [-0.5, 0.5]."""
    span = value if isinstance(value, list) else [-value, value]
    if len(span) != 2 or not np.isfinite(span).all() or not span[0] < span[1]:
        raise told(f"its range {value} must be two numbers that rise, or one above 0")
    return float(span[0]), float(span[1])


def check_added(spec: mujoco.MjSpec, added: Sequence[Added], at: At) -> None:
    """Checks that actuators can be added to a model.

    Raises:
      UserError: if there is no such joint, or an actuator of that name.
    """
    joints = [joint.name for joint in spec.joints if joint.name]
    there = [actuator.name for actuator in spec.actuators]
    for actuator in added:
        told = at("actuators", actuator.joint)
        if actuator.joint not in joints:
            raise told(f"the model has no joint {actuator.joint}{nearest(actuator.joint, joints)}")
        if actuator.joint in there:
            raise told("the model has an actuator of that name; leave this one out, or take that one out of the model")


def add_actuators(spec: mujoco.MjSpec, added: Sequence[Added]) -> None:
    """Adds actuators to a model that is not compiled, and drops the keyframes' numbers for actuators."""
    for actuator in added:
        made = spec.add_actuator(
            name=actuator.joint,
            target=actuator.joint,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            ctrlrange=[actuator.low, actuator.high],
            ctrllimited=True,
        )
        if actuator.kind == MOTOR:
            made.set_to_motor()
            made.gear[0] = actuator.gain
        elif actuator.kind == POSITION:
            made.set_to_position(kp=actuator.gain, kv=actuator.damping)
        else:
            made.set_to_velocity(kv=actuator.gain)
        if actuator.force is not None:
            made.forcerange, made.forcelimited = [-actuator.force, actuator.force], True
    if added:
        for key in spec.keys:  # they belong to the actuators before
            key.ctrl, key.act = [], []


def commanded(model: mujoco.MjModel, asked: Sequence[str], at: At) -> list[str]:
    """The names of the commanded actuators: the ones asked for, or all.

    Raises:
      UserError: if there is no such actuator, or one has no range.
    """
    names = quantities.names_in(model, "actuator")
    chosen = list(asked) or names
    for i, name in enumerate(chosen):
        told = at("commands", str(i)) if asked else at("commands")
        if name not in names:
            raise told(f"the model has no actuator {name}{nearest(name, names)}")
        if chosen.index(name) < i:
            raise told(f"{name} is there before; name each once")
        low, high = model.actuator_ctrlrange[names.index(name)]
        if not model.actuator_ctrllimited[names.index(name)] or not low < high:
            raise told(
                f"the actuator {name} has no range, so nobody knows what a full command is; give it "
                'ctrlrange="LOW HIGH" in the MJCF file'
            )
        if (reach := _beyond(model, names.index(name))) is not None:
            raise told(
                f"the actuator {name} sends its joint from {low:g} to {high:g} rad, which moves from {reach[0]:.3g} to "
                f"{reach[1]:.3g} rad; MuJoCo takes ctrlrange in rad, whatever its angle is; write "
                'inheritrange="1" in its place in the MJCF file'
            )
    return chosen


def _beyond(model: mujoco.MjModel, actuator: int) -> Array | None:
    """The range of a hinge, rad, if a position actuator's commands are so far beyond it that they must be degrees."""
    joint = int(model.actuator_trnid[actuator, 0])
    if (
        model.actuator_trntype[actuator] not in OF_JOINT
        or model.actuator_biasprm[actuator, 1] == 0
        or model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE
        or not model.jnt_limited[joint]
    ):
        return None
    asked, there = np.ptp(model.actuator_ctrlrange[actuator]), np.ptp(model.jnt_range[joint])
    return np.array(model.jnt_range[joint]) if asked > BEYOND * there * abs(model.actuator_gear[actuator, 0]) else None


def driven_joints(model: mujoco.MjModel) -> list[int]:
    """The hinges and slides that the actuators drive, rising; all hinges and slides where no actuator drives one."""
    driven = {int(model.actuator_trnid[row, 0]) for row in range(model.nu) if drives_one(model, row)}
    return sorted(driven) or [joint for joint in range(model.njnt) if model.jnt_type[joint] in SINGLE]


def drives_one(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator drives a single hinge or slide."""
    return bool(
        model.actuator_trntype[actuator] in OF_JOINT and model.jnt_type[model.actuator_trnid[actuator, 0]] in SINGLE
    )


def sets_speed(model: mujoco.MjModel, actuator: int) -> bool:
    """Whether an actuator's command is the speed of the hinge or slide that it drives."""
    position, velocity = model.actuator_biasprm[actuator, 1:3]
    return bool(drives_one(model, actuator) and position == 0 and velocity != 0)


def feedback_gains(
    model: mujoco.MjModel, feedback: Mapping[str, Any], columns: Mapping[tuple[str, int], int], width: int, at: At
) -> Array:
    """K, for algorithm.feedback=-1, its default, is what the page says; shape (nu, width).

    Args:
      model: whose actuators are all commanded.
      feedback: actuator => gain or [gain, gain of the velocity] on its own joint, or joint => such gains.
      columns: ("qpos" or "qvel", address) => where that number lies among the features.
      width: of the features.
      at: tells mistakes.

    Raises:
      UserError: if there is no such command or joint, or nothing that can be fed back.
    """
    names, joints = quantities.names_in(model, "actuator"), quantities.names_in(model, "joint")
    gain = np.zeros((model.nu, width))
    for name, value in feedback.items():
        told = at("feedback", name)
        if name not in names:
            raise told(f"there is no command {name}{nearest(name, names)}")
        row = names.index(name)
        if isinstance(value, dict):
            by_joint = {joint: (gains, at("feedback", name, joint)) for joint, gains in value.items()}
        elif model.actuator_trntype[row] not in OF_JOINT:
            raise told(
                f"the actuator {name} drives no single joint; say which joints are fed back, as {name}: {{JOINT: -1}}, "
                "or leave it out"
            )
        else:
            by_joint = {joints[int(model.actuator_trnid[row, 0])]: (value, told)}
        for joint, (gains, here) in by_joint.items():
            for field, address, number in _fed_back(model, joints, joint, gains, here):
                gain[row, columns[field, address]] = -number
    return gain


def _fed_back(
    model: mujoco.MjModel, joints: Sequence[str], name: str, gains: Any, told: Told
) -> list[tuple[str, int, float]]:
    """Field, address and gain of what a joint feeds back."""
    if name not in joints:
        raise told(f"the model has no joint {name}{nearest(name, joints)}")
    joint = joints.index(name)
    if model.jnt_type[joint] not in SINGLE:
        raise told(f"the joint {name} has more than one number, which no single gain is for; leave it out")
    numbers = gains if isinstance(gains, list) else [gains]
    if len(numbers) > 2 or not np.isfinite(numbers).all():
        raise told("expected one number or two, for position and velocity")
    places = (("qpos", int(model.jnt_qposadr[joint])), ("qvel", int(model.jnt_dofadr[joint])))
    return [(field, address, float(number)) for (field, address), number in zip(places, numbers, strict=False)]
