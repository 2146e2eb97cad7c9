"""Settings that check themselves: dataclasses whose fields say what they mean and which values they may have.

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
from collections.abc import Sequence
from dataclasses import MISSING, dataclass
from typing import Any

from tltlrl.errors import UserError, nearest


@dataclass(frozen=True)
class Setting:
    """What a field means and what it may be.

    Attributes:
      meaning: a phrase for the help page, with the unit.
      least, most: bounds that a number may reach; of a list or a mapping each number in it.
      above, below: bounds that it may not reach.
      choices: the words that it may be, or none for any.
      budget: whether it only makes a run cheaper or dearer (a search varies none of these).
      place: whether it says where something lies that has a digest of its own: a run is the same wherever that is.
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
    """A dataclass field with its meaning and its bounds; see `Setting`. A list or mapping as default is copied."""
    metadata = {"setting": Setting(meaning, **bounds)}
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=default.copy, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def settings_of(kind: type) -> dict[str, Setting]:
    """Name => setting, of the fields of a dataclass that have one."""
    return {f.name: f.metadata["setting"] for f in dataclasses.fields(kind) if "setting" in f.metadata}


def without_places(settings: Any) -> dict[str, Any]:
    """A dataclass of settings as plain data, but for those that say where something lies."""
    known = settings_of(type(settings))
    return {
        key: value for key, value in dataclasses.asdict(settings).items() if key not in known or not known[key].place
    }


def check(settings: Any, section: str) -> None:
    """Whether every field of a dataclass is within its bounds.

    Raises:
      UserError: naming `section`.key, the value and what it may be.
    """
    for name, allowed in settings_of(type(settings)).items():
        check_value(f"{section}.{name}", getattr(settings, name), allowed)


def check_value(key: str, value: Any, allowed: Setting) -> None:
    """Whether a value is finite, within its bounds and one of its choices.

    Raises:
      UserError: naming the key.
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
