"""Relative entropy policy search: pure functions on arrays, which know no task and no simulator."""

from tltlrl.learning.reps.dual import Weighting, solve_dual
from tltlrl.learning.reps.update import COVARIANCE_RULES, Update, episode_based, fit, reward_to_go, step_based

__all__ = [
    "COVARIANCE_RULES",
    "Update",
    "Weighting",
    "episode_based",
    "fit",
    "reward_to_go",
    "solve_dual",
    "step_based",
]
