"""One policy update: samples and their returns in, the new mean and covariance of the offsets out.

Weighted maximum likelihood (case study, section 3.3.3) with the weights of the dual:

    k_t' = sum_i p_i delta_{i,t}        Sigma_t' = sum_i p_i (delta_{i,t} - k_t') (delta_{i,t} - k_t')^T

Episode-based REPS has one p_i per trajectory, from its return R_i. Step-based REPS (Chebotar et al. 2017, Path
Integral Guided Policy Search) has one P_{i,t} per trajectory and step, from the reward-to-go

    S_{i,t} = sum_{j >= t} r_{i,j}

A bound on the samples' KL does not bound the fitted Gaussian: from 20 samples the published fit shrinks whatever the
returns say. The damped fit measures the spread about the *old* mean, which has the old covariance as its expectation
when returns carry no signal, keeps its diagonal, and moves only part of the way towards it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.reps.dual import Weighting, solve_dual

Array = NDArray[np.float64]
COVARIANCE_RULES = ("damped", "published")


@dataclass(frozen=True)
class Update:
    """The next search distribution and how it came about.

    Attributes:
      mean: k_t', shape (T, d).
      covariance: Sigma_t', shape (T, d, d).
      weighting: the dual's solution; leading axis T if step-based.
    """

    mean: Array
    covariance: Array
    weighting: Weighting


def reward_to_go(rewards: Array) -> Array:
    """S_{i,t} = sum_{j >= t} r_{i,j}: shape (N, T) => (N, T)."""
    return np.asarray(np.cumsum(rewards[:, ::-1], axis=1)[:, ::-1])


def episode_based(
    offsets: Array,
    returns: Array,
    mean: Array,
    covariance: Array,
    epsilon: float,
    rule: str,
    kept: float,
) -> Update:
    """Episode-based REPS.

    Args:
      offsets: delta_{i,t} = u_{i,t} - K_t s_{i,t}, shape (N, T, d).
      returns: R_i, shape (N,).
      mean, covariance: k_t (T, d) and Sigma_t (T, d, d) that the offsets were drawn from.
      epsilon: bound of the dual, nats.
      rule, kept: see `fit`.
    """
    weighting = solve_dual(returns, epsilon)
    weights = np.broadcast_to(weighting.weights, (offsets.shape[1], len(returns)))
    return Update(*fit(offsets, weights, mean, covariance, rule, kept), weighting)


def step_based(
    offsets: Array,
    rewards: Array,
    mean: Array,
    covariance: Array,
    epsilon: float,
    rule: str,
    kept: float,
) -> Update:
    """Step-based REPS: as `episode_based`, but one dual per time step on the reward-to-go of `rewards` (N, T)."""
    weighting = solve_dual(reward_to_go(rewards).T, epsilon)
    return Update(*fit(offsets, weighting.weights, mean, covariance, rule, kept), weighting)


def fit(offsets: Array, weights: Array, mean: Array, covariance: Array, rule: str, kept: float) -> tuple[Array, Array]:
    """Weighted maximum-likelihood Gaussian of every time step.

    Args:
      offsets: shape (N, T, d).
      weights: shape (T, N), each row summing to 1.
      mean, covariance: those the offsets were drawn from, (T, d) and (T, d, d).
      rule: "published" is the fit above; "damped" its remedy, covariance = kept * old + (1 - kept) * diagonal fit
        about the old mean.
      kept: the old covariance's share in the damped one, in [0, 1).

    Returns:
      The new mean (T, d) and covariance (T, d, d).

    Raises:
      ValueError: if there is no such rule.
    """
    if rule not in COVARIANCE_RULES:
        raise ValueError(f"no covariance rule is named {rule!r}; there are {', '.join(COVARIANCE_RULES)}")
    by_step = offsets.transpose(1, 0, 2)  # (T, N, d)
    new_mean = (weights[:, None, :] @ by_step)[:, 0]
    if rule == "published":
        spread = by_step - new_mean[:, None]
        return new_mean, (weights[:, None, :] * spread.transpose(0, 2, 1)) @ spread
    squares = (by_step - mean[:, None]) ** 2
    variance = (weights[:, None, :] @ squares)[:, 0]
    return new_mean, kept * covariance + (1 - kept) * variance[:, :, None] * np.eye(offsets.shape[2])
