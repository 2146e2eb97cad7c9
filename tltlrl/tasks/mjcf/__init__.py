"""A robot described by an MJCF file and a page of YAML: keys, page, model, signals, and the task made of them.

`keys` has the table of keys, from which docs/robot-yaml.md is made.
"""

from __future__ import annotations

from tltlrl.tasks.mjcf.evaluation import evaluation_of
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.robot import Robot
from tltlrl.tasks.task import TaskEntry

MJCF = TaskEntry(config=RobotConfig, make=Robot, evaluation=evaluation_of)
