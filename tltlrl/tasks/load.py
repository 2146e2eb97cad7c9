"""`load_task`: makes a task by its name, or a robot by its page, for `dm_env` users."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from dm_control.rl import control

from tltlrl.errors import UserError
from tltlrl.logic import load_spec
from tltlrl.registry import OUTSIDE, TASKS
from tltlrl.resources import is_page, spec_path
from tltlrl.tasks.environment import environment
from tltlrl.tasks.fits import check_fits
from tltlrl.tasks.task import TaskEntry


def load_task(name: str | Path, seed: int | None = None) -> control.Environment:
    """Makes a task with default settings, as a `dm_env.Environment`.

        env = tltlrl.load_task("reach_avoid")
        env = tltlrl.load_task("arm.yaml")

    Its reward is the task's first hand-made reward, or if it has none, the robustness of its spec. The spec of a robot
    is the file beside its page, of the same name; without one the reward is 0.

    Args:
      name: a name in the registry of tasks, or the page of a robot (docs/bring-your-robot.md).
      seed: seed of the actuators' noise.

    Raises:
      UserError: if there is no such task, something is wrong with a page, or the task is an environment of others.
    """
    name = str(name)
    config: Any
    if is_page(name):
        from tltlrl.tasks.mjcf.file import config_of, path_of, spec_beside

        path = path_of(name)
        config, own = config_of(path), spec_beside(path)
        entry: TaskEntry = TASKS.get(config.name)
    else:
        entry = TASKS.get(name)
        config, own = entry.config(), spec_path(entry.spec) if entry.spec else None
    if name in OUTSIDE:
        raise UserError(f"{name}: its environments step by themselves; load one with {OUTSIDE[name]}")
    task = entry.make(config)
    spec = load_spec(own).sampled(task.control_timestep) if own else None
    if spec is not None:
        check_fits(spec, task)
    reward = entry.rewards(entry.reward(), spec.constants)[entry.hand_made[0]] if entry.hand_made and spec else spec
    return environment(task, reward, random=seed)
