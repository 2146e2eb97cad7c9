"""Where configs and specs lie: inside the package in a wheel, beside it in a checkout."""

from __future__ import annotations

import os
from pathlib import Path

from tltlrl.errors import UserError, nearest

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


CONFIGS = _folder("configs")
SPECS = _folder("specs")
OFFERED = "page_"  # begins the names by which robots' pages are among Hydra's choices


def user_path(text: str) -> Path:
    """A path as the user wrote it, with ~ replaced by the home folder: no shell does that inside a config."""
    return Path(os.path.expanduser(text))  # Path.expanduser raises for ~nobody


def spec_path(name: str) -> Path:
    """The spec file that `name` stands for: the user's own if it is a path to one, otherwise one shipped with tltlrl.

    Raises:
      UserError: if there is no such file.
    """
    for path in (user_path(name), SPECS / name, SPECS / f"{name}.tltl"):
        if path.is_file():
            return path
    raise UserError(
        f"no spec file {name} here or in {SPECS}{nearest(name, (path.name for path in SPECS.glob('*.tltl')))}"
    )


def is_page(task: str) -> bool:
    """Whether the value of `task` is a path to a robot's page, not a name."""
    return task.strip("'\"").lower().endswith((".yaml", ".yml"))
