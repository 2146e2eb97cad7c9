"""Compares two configs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A nested config as one mapping, with keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


def differences(
    before: Mapping[str, Any], now: Mapping[str, Any], growing: Collection[str] = (), added: Collection[str] = ()
) -> str:
    """The differences that keep one config from continuing the results of another, one per line; empty if none.

    For a spec or a robot's page only the file's name is compared here, not its folder: the spec's text is compared
    elsewhere, and so are all keys of the page.

    Args:
      before, now: the two configs.
      growing: keys, with their sections, whose lists or numbers may be larger now.
      added: keys, with their sections, that `before` may lack.
    """
    old, new = (
        {
            key: Path(str(value)).name if key in ("spec", "task.file") else value
            for key, value in flatten(config).items()
        }
        for config in (before, now)
    )
    free = {*growing, *(key for key in added if key not in old)}
    lines = [
        f"  {key}: {old.get(key, 'absent')} there, {new.get(key, 'absent')} now"
        for key in sorted(old.keys() | new.keys())
        if old.get(key) != new.get(key) and key not in free
    ]
    lines += [
        f"  {key}: {old.get(key)} there, {new.get(key)} now (they can only grow)"
        for key in growing
        if not _grows(old.get(key), new.get(key))
    ]
    return "\n".join(lines)


def _grows(before: Any, now: Any) -> bool:
    if isinstance(before, int) and isinstance(now, int):
        return before <= now
    return _members(before) <= _members(now)


def _members(value: Any) -> set[str]:
    members = range(value) if isinstance(value, int) else value
    return {str(member) for member in members} if isinstance(members, range | list) else {str(value)}
