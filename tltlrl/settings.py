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
from typing import Any

from tltlrl.errors import UserError, nearest


@dataclass(frozen=True)
class Setting:
    """The meaning and the bounds of a field.

    Attributes:
      meaning: a phrase for the help page, with the unit.
      least, most: bounds that a number may reach. In a list or a mapping they hold for each number.
      above, below: bounds that a number may not reach.
      choices: the allowed words; empty if any is allowed.
      budget: whether the field decides how much a run computes (a search varies no such field).
      place: whether the field is a path to something with a digest of its own: moving that changes no run.
    """

    meaning: str
    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()
    budget: bool = False
    place: bool = False


def setting(meaning: str, default: Any = MISSING, **bounds: Any) -> Any:
    """A dataclass field with its meaning and its bounds; see `Setting`. A default list or mapping is copied."""
    metadata = {"setting": Setting(meaning, **bounds)}
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=default.copy, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def settings_of(kind: type) -> dict[str, Setting]:
    """Name => setting, for the fields of a dataclass that have one."""
    return {f.name: f.metadata["setting"] for f in dataclasses.fields(kind) if "setting" in f.metadata}


def without_places(settings: Any) -> dict[str, Any]:
    """A dataclass of settings as plain data, without the fields that are a `place`."""
    known = settings_of(type(settings))
    return {
        key: value for key, value in dataclasses.asdict(settings).items() if key not in known or not known[key].place
    }


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
