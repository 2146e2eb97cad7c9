"""Planar arm domain: both simulated 2D tasks of the case study, with three links, goals and obstacles.

The model is in arm.xml, the task in scene.py, the hand-made rewards in rewards.py.
"""

from tltlrl.tasks.planar_arm.rewards import (
    ReachAvoidReward,
    VisitInOrderReward,
    reach_avoid_rewards,
    visit_in_order_rewards,
)
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig, VisitInOrderConfig
from tltlrl.tasks.task import TaskEntry

__all__ = ["REACH_AVOID", "VISIT_IN_ORDER"]

REACH_AVOID = TaskEntry(
    config=PlanarArmConfig,
    make=PlanarArm,
    spec="reach_avoid.tltl",
    reward=ReachAvoidReward,
    rewards=reach_avoid_rewards,
    hand_made=("discrete", "continuous"),
)
VISIT_IN_ORDER = TaskEntry(
    config=VisitInOrderConfig,
    make=PlanarArm,
    spec="visit_in_order.tltl",
    reward=VisitInOrderReward,
    rewards=visit_in_order_rewards,
    hand_made=("discrete", "continuous"),
)
