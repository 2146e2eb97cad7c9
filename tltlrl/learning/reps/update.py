"""The fit of the policy: weighted samples => new mean and covariance of the offsets.

Weighted maximum likelihood (case study, section 3.3.3) with the weights of the dual:

    k_t' = sum_i p_i delta_{i,t}        Sigma_t' = sum_i p_i (delta_{i,t} - k_t') (delta_{i,t} - k_t')^T

Episode-based REPS has one p_i per trajectory, from its return R_i. Step-based REPS (Chebotar et al. 2017, Path
Integral Guided Policy Search) has one P_{i,t} per trajectory and step, from the reward-to-go

    S_{i,t} = sum_{j >= t} r_{i,j}

A bound on the samples' KL does not bound the fitted Gaussian: with 20 samples the published fit shrinks whatever the
returns are. The damped fit measures the spread about the *old* mean. Where returns carry no signal, the expectation of
this spread is the old covariance. The damped fit uses its diagonal alone, and moves only part of the way to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
COVARIANCE_RULES = ("damped", "published")


def reward_to_go(rewards: Array) -> Array:
    """The rewards-to-go S_{i,t} = sum_{j >= t} r_{i,j}: shape (N, T) => (N, T)."""
    return np.asarray(np.cumsum(rewards[:, ::-1], axis=1)[:, ::-1])


def fit(offsets: Array, weights: Array, mean: Array, covariance: Array, rule: str, kept: float) -> tuple[Array, Array]:
    """Fits a Gaussian to the weighted offsets of every time step, by weighted maximum likelihood.

    Args:
      offsets: shape (N, T, d).
      weights: shape (T, N), each row summing to 1.
      mean, covariance: of the policy that drew the offsets, (T, d) and (T, d, d).
      rule: "published", the fit above, or "damped": kept * old covariance + (1 - kept) * diagonal fit about the old
        mean.
      kept: share of the old covariance in the damped fit, in [0, 1).

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
