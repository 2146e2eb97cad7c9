"""Relative entropy policy search: the dual, the fit, and the two learners made of them."""

from tltlrl.learning.reps.dual import Weighting, solve_dual
from tltlrl.learning.reps.learner import EpisodeBased, RepsSettings, StepBased
from tltlrl.learning.reps.update import COVARIANCE_RULES, fit, reward_to_go

__all__ = [
    "COVARIANCE_RULES",
    "EpisodeBased",
    "RepsSettings",
    "StepBased",
    "Weighting",
    "fit",
    "reward_to_go",
    "solve_dual",
]
