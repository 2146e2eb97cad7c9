"""`load_task`: makes a built-in or installed task by its name, for `dm_env` users."""

from __future__ import annotations

from dm_control.rl import control

from tltlrl.logic import load_spec
from tltlrl.registry import TASKS
from tltlrl.resources import spec_path
from tltlrl.tasks.environment import environment
from tltlrl.tasks.task import TaskEntry


def load_task(name: str, seed: int | None = None) -> control.Environment:
    """Makes a task with default settings, as a `dm_env.Environment`.

    Its reward is the task's first hand-made reward, or if it has none, the robustness of its spec.

    Args:
      name: a name in the registry of tasks.
      seed: seed of the actuators' noise.

    Raises:
      UserError: if there is no such task.
    """
    entry: TaskEntry = TASKS.get(name)
    spec = load_spec(spec_path(entry.spec)) if entry.spec else None
    reward = entry.rewards(entry.reward(), spec.constants)[entry.hand_made[0]] if entry.hand_made and spec else spec
    return environment(entry.make(entry.config()), reward, random=seed)
