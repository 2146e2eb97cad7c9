"""What differs between two configs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def differences(before: Mapping[str, Any], now: Mapping[str, Any], growing: tuple[str, ...] = ()) -> str:
    """What keeps results of one config from being continued under another, one line each; empty if nothing does.

    A spec is the same if its file's name is, wherever it lies: its text is compared apart. A setting of `algorithm`
    that is absent there belongs to a learner that had no case there (`read` keeps all settings of those that had).

    Args:
      before, now: the two configs.
      growing: keys with several members, which may have more of them now.
    """
    old, new = (flatten(config) | {"spec": Path(str(config.get("spec"))).name} for config in (before, now))
    lines = [
        f"  {key}: {old.get(key, 'absent')} there, {new.get(key, 'absent')} now"
        for key in sorted(old.keys() | new.keys())
        if old.get(key) != new.get(key) and key not in growing and (key in old or not key.startswith("algorithm."))
    ]
    lines += [
        f"  {key}: {before.get(key)} there, {now.get(key)} now (they can only grow)"
        for key in growing
        if not _members(before.get(key)) <= _members(now.get(key))
    ]
    return "\n".join(lines)


def _members(value: Any) -> set[Any]:
    return set(range(value)) if isinstance(value, int) else set(value or ())
