"""Settings that check themselves: dataclasses whose fields hold their meaning and their bounds.

    @dataclass(frozen=True)
    class ArmConfig:
        steps: int = setting("samples of one episode", least=2)

        def __post_init__(self) -> None:
            check(self, "task")

The help page, the refusal of a wrong value and the reader of a config all read these fields.
"""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Sequence
from dataclasses import MISSING, dataclass
from enum import Flag, auto
from typing import Any

from tltlrl.errors import UserError, nearest


class Role(Flag):
    """The roles of a key. Without any of them, another value simply makes another experiment.

    NAMES: it names the folder of the results. GROWS: a larger value extends a folder. BUDGET: it decides how much is
    computed; the command for a search's best candidate leaves it out. SEARCHED: `tltl search` may vary it. MACHINERY:
    it changes no result; a result's config.yaml leaves it out. CHOSEN: its value is chosen by the name of a file in
    configs/. COMMON: no part of a run may have a value of its own, neither a second stage nor the evaluation. LATER:
    results of 0.1 lack it, and have its default. PLACE: a path, of which only the file's name and content count.
    """

    NONE = 0
    NAMES = auto()
    GROWS = auto()
    BUDGET = auto()
    SEARCHED = auto()
    MACHINERY = auto()
    CHOSEN = auto()
    COMMON = auto()
    LATER = auto()
    PLACE = auto()


@dataclass(frozen=True)
class Setting:
    """The meaning, the role and the bounds of a key.

    Attributes:
      meaning: a phrase for the help page, with the unit.
      least, most: bounds that a number may reach. In a list or a mapping they hold for each number.
      above, below: bounds that a number may not reach.
      choices: the allowed words; empty if any is allowed.
      role: its roles.
      kind, example: on a robot's page, the kind of its value, in words, and an example of a value, as YAML.
    """

    meaning: str
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()
    role: Role = Role.NONE
    kind: str = ""
    example: str = ""


def setting(meaning: str, default: Any = MISSING, **more: Any) -> Any:
    """A dataclass field with its meaning, role and bounds; see `Setting`. A default list or mapping is copied."""
    metadata = {"setting": Setting(meaning, **more)}
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=default.copy, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def settings_of(kind: type) -> dict[str, Setting]:
    """Name => setting, for the fields of a dataclass that have one."""
    return {f.name: f.metadata["setting"] for f in dataclasses.fields(kind) if "setting" in f.metadata}


def fields_with(role: Role, kind: type) -> list[str]:
    """The fields of a dataclass with any of these roles."""
    return [name for name, its in settings_of(kind).items() if its.role & role]


def without_places(settings: Any) -> dict[str, Any]:
    """A dataclass of settings as plain data, without the fields with the role `Role.PLACE`."""
    places = fields_with(Role.PLACE, type(settings))
    return {key: value for key, value in dataclasses.asdict(settings).items() if key not in places}


def check(settings: Any, section: str) -> None:
    """Checks that every field of a dataclass is within its bounds, and a whole number where it has to be.

    Raises:
      UserError: if one is not; it names `section`.key, the value and the bound.
    """
    for field in dataclasses.fields(settings):
        if (allowed := field.metadata.get("setting")) is None:
            continue
        key, value = f"{section}.{field.name}", getattr(settings, field.name)
        if not _whole(field.type, value):
            raise UserError(f"{key}: expected a whole number, not {value!r}")
        check_value(key, value, allowed)


def _whole(kind: Any, value: Any) -> bool:
    """Whether a value has whole numbers where the type of its field, maybe written as text, asks for them."""
    match kind.__name__ if isinstance(kind, type) else str(kind):
        case "int":
            return isinstance(value, numbers.Integral) and not isinstance(value, bool)
        case "int | None":
            return value is None or _whole("int", value)
        case "list[int]":
            return all(_whole("int", part) for part in value)
    return True


def check_value(key: str, value: Any, allowed: Setting) -> None:
    """Checks that a value is finite, within its bounds and one of its choices.

    Raises:
      UserError: if it is not; it names the key.
    """
    if allowed.choices and value not in allowed.choices:
        raise UserError(f"{key}: there is no {value}{nearest(str(value), allowed.choices)}")
    for number in _numbers(value):
        if isinstance(number, float) and not math.isfinite(number):
            raise UserError(f"{key}: {number} is not a finite number")
        if allowed.least is not None and number < allowed.least:
            raise UserError(f"{key}: {number} is too small; it must be at least {allowed.least}")
        if allowed.above is not None and number <= allowed.above:
            raise UserError(f"{key}: {number} is too small; it must be above {allowed.above}")
        if allowed.most is not None and number > allowed.most:
            raise UserError(f"{key}: {number} is too large; it must be at most {allowed.most}")
        if allowed.below is not None and number >= allowed.below:
            raise UserError(f"{key}: {number} is too large; it must be below {allowed.below}")


def _numbers(value: Any) -> Sequence[float]:
    if isinstance(value, dict):
        return _numbers(list(value.values()))
    if isinstance(value, list | tuple):
        return [number for part in value for number in _numbers(part)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []
