"""A folder of results, of an experiment or of a search: held by one process, known by its record, emptied."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import yaml

from tltlrl.errors import UserError
from tltlrl.store.bounded import read_yaml
from tltlrl.store.layout import LOCK
from tltlrl.store.lock import BusyError, held


@contextlib.contextmanager
def working_in(folder: Path) -> Iterator[None]:
    """Locks the folder for this process.

    Raises:
      UserError: if another process holds it, or it cannot be written.
    """
    try:
        with held(folder):
            yield
    except BusyError as error:
        raise UserError(f"{error}; wait for it, or set another name=...") from error


def read_record(file: Path, keys: Collection[str]) -> dict[str, Any] | None:
    """The content of a YAML file with exactly these keys; None if there is no such file."""
    try:
        content = read_yaml(file)
    except (OSError, ValueError, yaml.YAMLError):  # ValueError: not UTF-8
        return None
    return content if is_record(content, keys) else None


def is_record(content: Any, keys: Collection[str]) -> bool:
    """Whether the content is a mapping with exactly these keys."""
    return isinstance(content, dict) and set(content) == set(keys)


def empty(folder: Path, record: Path) -> None:
    """Deletes everything in the folder but its lock.

    The record goes last: if this is stopped halfway, the folder can still be recognised as ours.
    """
    for entry in sorted(folder.iterdir(), key=lambda entry: entry == record):
        if entry.name != LOCK:
            shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink()
