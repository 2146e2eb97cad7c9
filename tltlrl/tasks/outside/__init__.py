"""Environments of others as tasks: from Gymnasium and from dm_control's suite.

Their observations become features and signals. Their own reward becomes a hand-made reward, `environment`.
"""

from __future__ import annotations

from tltlrl.tasks.outside.keys import GymnasiumConfig, SuiteConfig
from tltlrl.tasks.outside.task import OutsideTask, own_rewards
from tltlrl.tasks.task import TaskEntry

GYMNASIUM = TaskEntry(
    config=GymnasiumConfig,
    make=OutsideTask,
    rewards=own_rewards,
    hand_made=("environment",),
    packages=("gymnasium",),
)
SUITE = TaskEntry(config=SuiteConfig, make=OutsideTask, rewards=own_rewards, hand_made=("environment",))
