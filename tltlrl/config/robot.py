"""Makes a robot's page a task that can be chosen: `task=./arm.yaml`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from tltlrl.errors import UserError
from tltlrl.store.files import digest
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.model import page_digest
from tltlrl.tasks.mjcf.page import read_page, task_name
from tltlrl.tasks.task import NoReward


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


def standing(path: Path) -> dict[str, str]:
    """What a page's experiment is called, and the spec beside it, of the same name, if there is one."""
    spec = path.with_suffix(".tltl")
    return {"name": task_name(path)} | ({"spec": str(spec)} if spec.is_file() else {})


def offer(path: Path) -> str:
    """Adds a page to Hydra's choices as a task; returns its name there."""
    from hydra.core.config_store import ConfigStore

    name = f"page_{digest(str(path).encode())[:16]}"
    values: dict[str, Any] = dataclasses.asdict(config_of(path))
    ConfigStore.instance().store(name, values, "task")
    ConfigStore.instance().store(name, dataclasses.asdict(NoReward()), "reward")
    return name
