"""A robot's page as a file: found, read, with the digest of its model, and the spec beside it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from tltlrl.errors import UserError
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.model import page_digest
from tltlrl.tasks.mjcf.page import read_page


def path_of(task: str) -> Path:
    """The path of the page.

    Raises:
      UserError: if there is no such file.
    """
    path = Path(task.strip("'\"")).expanduser()
    if not path.is_file():
        raise UserError(
            f"task={task}: there is no such file; give the page of a robot, or make one: tltl new MODEL.xml"
        )
    return path.resolve()


def config_of(path: Path) -> RobotConfig:
    """The config on a page, with the digest of its model.

    Raises:
      UserError: if the page has a mistake; it names file, line and key.
    """
    config = RobotConfig(file=str(path), **read_page(path).values)
    return dataclasses.replace(config, digest=page_digest(config))


def spec_beside(path: Path) -> Path | None:
    """The spec beside a page, of the same name, if there is one."""
    spec = path.with_suffix(".tltl")
    return spec if spec.is_file() else None
