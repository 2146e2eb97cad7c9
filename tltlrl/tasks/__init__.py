"""The tasks by name: what a config needs to build one, and `load_task` for `dm_env` users."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import yaml

from tltlrl.tasks.headless import choose_renderer

choose_renderer()  # before anything imports dm_control; hence the imports below

from dm_control.rl import control

from tltlrl.errors import UserError, nearest
from tltlrl.logic import load_spec
from tltlrl.resources import CONFIGS, spec_path
from tltlrl.tasks import planar_arm, toast
from tltlrl.tasks.task import StepReward, Task, environment


@dataclass(frozen=True)
class TaskEntry:
    """How to build a task from configuration.

    Attributes:
      config: dataclass of the task's own settings.
      reward: dataclass of its hand-made rewards' coefficients.
      rewards: (coefficients, spec constants) => the hand-made rewards by name.
      make: (config, rewards, random) => the task.
      hand_made: names of the hand-made rewards.
      evaluation: the config of the scene that learned policies are tried in, from that of training.
    """

    config: type
    reward: type
    rewards: Callable[[Any, Mapping[str, Any]], dict[str, StepReward]]
    make: Callable[..., Task]
    hand_made: tuple[str, ...] = ("discrete", "continuous")
    evaluation: Callable[[Any], Any] = lambda config: config


TASKS: dict[str, TaskEntry] = {
    "reach_avoid": TaskEntry(
        planar_arm.PlanarArmConfig,
        planar_arm.ReachAvoidReward,
        planar_arm.reach_avoid_rewards,
        planar_arm.PlanarArm,
    ),
    "visit_in_order": TaskEntry(
        planar_arm.PlanarArmConfig,
        planar_arm.VisitInOrderReward,
        planar_arm.visit_in_order_rewards,
        planar_arm.PlanarArm,
    ),
    "toast": TaskEntry(
        toast.ToastConfig,
        toast.ToastReward,
        toast.toast_rewards,
        toast.Toast,
        hand_made=("continuous",),
        evaluation=lambda config: dataclasses.replace(config, solid=True),
    ),
}


def task_entry(name: str) -> TaskEntry:
    """The entry of `name`.

    Raises:
      UserError: if there is no such task.
    """
    if name not in TASKS:
        raise UserError(f"no task is named {name}{nearest(name, TASKS)}")
    return TASKS[name]


def load_task(name: str, seed: int | None = None) -> control.Environment:
    """A task with its default settings as a `dm_env.Environment`; its reward is the discrete one, if the task has it.

    Args:
      name: one of `TASKS`.
      seed: of the actuators' noise.

    Raises:
      UserError: if there is no such task.
    """
    return environment(make_default(name, random=seed))


def make_default(name: str, random: int | None = None) -> Task:
    """The task `name` as the config, the rewards' config and the spec that come with tltlrl describe it."""
    config, reward = default_settings(name)
    entry = task_entry(name)
    return entry.make(config, entry.rewards(reward, load_spec(spec_path(name)).constants), random=random)


def default_settings(name: str) -> tuple[Any, Any]:
    """The config dataclasses of the task `name` and of its hand-made rewards, with the values that come with tltlrl."""
    entry = task_entry(name)
    config, reward = (
        kind(**yaml.safe_load((CONFIGS / group / f"{name}.yaml").read_text()))
        for kind, group in ((entry.config, "task"), (entry.reward, "reward"))
    )
    return config, reward
