"""Makes a robot's page a task that can be chosen: `task=./arm.yaml`."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from tltlrl.resources import OFFERED
from tltlrl.store.files import digest
from tltlrl.tasks.mjcf.file import config_of, spec_beside
from tltlrl.tasks.mjcf.page import task_name
from tltlrl.tasks.task import NoReward


def standing(path: Path) -> dict[str, str]:
    """What a page's experiment is called, and the spec beside it, if there is one."""
    spec = spec_beside(path)
    return {"name": task_name(path)} | ({} if spec is None else {"spec": str(spec)})


def offer(path: Path) -> str:
    """Adds a page to Hydra's choices as a task; returns its name there."""
    from hydra.core.config_store import ConfigStore

    name = f"{OFFERED}{digest(str(path).encode())[:16]}"
    values: dict[str, Any] = dataclasses.asdict(config_of(path))
    ConfigStore.instance().store(name, values, "task")
    ConfigStore.instance().store(name, dataclasses.asdict(NoReward()), "reward")
    return name
