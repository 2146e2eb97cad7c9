"""The signals of a robot: the quantities they are made of, and their places among the features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import mujoco

from tltlrl.errors import UserError
from tltlrl.logic import Spec, SpecError, is_signal_name, parse_spec
from tltlrl.tasks.mjcf import quantities
from tltlrl.tasks.mjcf.evaluation import At
from tltlrl.tasks.mjcf.model import Told
from tltlrl.tasks.mjcf.quantities import ModelQuantity
from tltlrl.tasks.task import Quantity

COMMAND = "command"
STATE = ("qpos", "qvel")  # the fields that need no sensor


def signals_named(
    model: mujoco.MjModel, given: Mapping[str, Any], joints: Sequence[str], at: At
) -> dict[str, list[ModelQuantity]]:
    """Signal => the quantities that it is made of, in order.

    Args:
      model: the model with the quantities.
      given: the page's `signals`; if empty, every sensor and the joints' positions and velocities are signals.
      joints: the joints that are features.
      at: makes error messages.

    Raises:
      UserError: if a name cannot be used, or a quantity is not in the model.
    """
    if not given:
        return _default_signals(model, joints, at("model"))
    found = {}
    for name, addresses in given.items():
        told = at("signals", name)
        if name == COMMAND:
            raise told("it is always what the policy sends; choose another name")
        check_signal_name(name, told)
        parts = addresses if isinstance(addresses, list) else [addresses]
        found[name] = [quantities.find(str(part), model, told) for part in parts]
    return found


def _default_signals(model: mujoco.MjModel, joints: Sequence[str], told: Told) -> dict[str, list[ModelQuantity]]:
    found = {field: [quantities.find(f"{field}.{name}", model, told) for name in joints] for field in STATE}
    for name in quantities.names_in(model, "sensor"):
        if name not in (*STATE, COMMAND) and is_signal_name(name):
            found[name] = [quantities.find(f"sensordata.{name}", model, told)]
    return found


def check_signal_name(name: str, told: Told) -> None:
    """Checks that a signal can have this name in a spec.

    Raises:
      UserError: if it cannot.
    """
    if not name.isidentifier():
        raise told(f"{name} cannot be a name in a spec; use letters, digits and _, a letter first")
    if not is_signal_name(name):
        raise told(f"{name} is a word of the language; choose another name")


def first_place(signals: Mapping[str, Sequence[ModelQuantity]]) -> str | None:
    """The first signal that is a position of a site, body or geom, by its address; None if there is none."""
    places = ("site_xpos", "xpos", "geom_xpos")
    alone = (parts[0] for parts in signals.values() if len(parts) == 1)
    return next((part.whole for part in alone if part.field in places and part.chosen is None), None)


def state_places(model: mujoco.MjModel, joints: Sequence[str]) -> tuple[list[int], list[int]]:
    """The indices in qpos and in qvel of the joints that are features."""
    there = quantities.names_in(model, "joint")
    qpos: list[int] = []
    qvel: list[int] = []
    for name in joints:
        i = there.index(name)
        sizes = [max(len(parts), 1) for parts in quantities.JOINT_PARTS[int(model.jnt_type[i])]]
        qpos += range(model.jnt_qposadr[i], model.jnt_qposadr[i] + sizes[0])
        qvel += range(model.jnt_dofadr[i], model.jnt_dofadr[i] + sizes[1])
    return qpos, qvel


def feature_groups(
    model: mujoco.MjModel, joints: Sequence[str], sensed: Mapping[str, ModelQuantity], told: Told
) -> tuple[Quantity, ...]:
    """The groups of features: positions and velocities of the joints, then what sensors say, by its address."""
    groups = []
    for field in STATE:
        parts = [quantities.find(f"{field}.{name}", model, told) for name in joints]
        labels = tuple(label for part in parts for label in _labels(part))
        groups.append(Quantity(field, quantities.FIELDS[field].unit, labels))
    groups += [Quantity(address, quantities.FIELDS[part.field].unit, _labels(part)) for address, part in sensed.items()]
    return tuple(groups)


def columns_of(signals: Mapping[str, Sequence[ModelQuantity]], observation: Sequence[Quantity]) -> dict[str, list[int]]:
    """Signal => the indices of its values among the features."""
    labels = [label for group in observation for label in group.parts]
    return {
        name: [
            labels.index(label)
            for part in parts
            for i, label in enumerate(_labels(part))
            if part.chosen is None or i == part.chosen
        ]
        for name, parts in signals.items()
    }


def _labels(part: ModelQuantity) -> tuple[str, ...]:
    """Names of all components of a quantity, as its features are called."""
    return tuple(f"{part.whole}.{component}" for component in part.parts) or (part.whole,)


def end_formula(text: str | None, sizes: Mapping[str, int], told: Told) -> Spec | None:
    """The formula that ends an episode where it holds; None if the page has none.

    Args:
      text: the formula's text on the page.
      sizes: signal => how many numbers.
      told: makes the error.

    Raises:
      UserError: if it cannot be read, or looks at other samples.
    """
    if text is None:
        return None
    declared = [f"signal {name}{f'[{size}]' * (size > 1)}\n" for name, size in sizes.items()]
    try:
        spec = parse_spec(f"{''.join(declared)}spec: {text}")
    except SpecError as error:
        raise told(f"{error.problem}\n    {text}") from None
    except UserError as error:
        raise told(str(error)) from None
    if spec.counts_seconds or spec.horizon != 0:
        raise told("it is asked at every sample by itself; leave out what looks at other samples, as F, G and X")
    return spec
