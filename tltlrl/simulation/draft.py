"""Drafts a page and a spec for a robot's model, from a short simulation."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tltlrl.errors import UserError
from tltlrl.simulation.probe import reached
from tltlrl.tasks.mjcf.actuators import commanded, sets_speed
from tltlrl.tasks.mjcf.draft import draft_page, draft_spec
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.model import compiled, model_path, read_model
from tltlrl.tasks.mjcf.page import page_of
from tltlrl.tasks.mjcf.robot import Robot

SHARE = 0.25  # radius of the goal, as a share of the way to it
IN_TIME = 0.8  # of the episode


@dataclass(frozen=True)
class Draft:
    """A first page and a first spec for a model.

    Attributes:
      page, spec: their texts.
      at_speeds: whether every command is the speed of a joint, so that a learned motion can be made calm.
    """

    page: str
    spec: str
    at_speeds: bool


def draft(model: str, page: Path) -> Draft:
    """A first page and a first spec for a model.

    Args:
      model: an MJCF file, or package:path.
      page: where the page will lie.

    Raises:
      UserError: if the model cannot be read, or no policy can command it.
    """

    def told(what: str) -> UserError:
        return UserError(f"{model}: {what}")

    path = model_path(model, Path.cwd(), told)
    checked = compiled(path, read_model(path))
    if not checked.nu or not checked.njnt:
        raise told(f"it has no {'joints' if checked.nu else 'actuators'}; a policy needs some to command")
    commanded(checked, (), lambda *_: told)
    named = model if ":" in model else os.path.relpath(path, page.resolve().parent)
    text = draft_page(checked, named, told)
    robot = Robot(RobotConfig(file=str(page.resolve()), **page_of(page, text.encode()).values))
    start, end = reached(robot, "tip", np.random.default_rng(0))
    radius = max(SHARE * float(np.linalg.norm(end - start)), 1e-3)
    at_speeds = all(sets_speed(checked, actuator) for actuator in range(checked.nu))
    return Draft(text, draft_spec(end, radius, IN_TIME * robot.config.duration), at_speeds)
