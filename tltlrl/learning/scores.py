"""What a learner is told of trajectories: their returns and, where known, the rewards of their steps.

The published return of a trajectory is the robustness of the spec, which is the value of its worst conjunct. The other
conjuncts change nothing in it. The leximin surrogate counts them too. It sorts their values from the worst,
c_(0) <= c_(1) <= ..., and weighs them by powers of a half,

    L = sum_k 2^-k c_(k)

It is a continuous surrogate of the leximin order, not that order itself, and its sign does not say whether the spec is
satisfied. So a learner may follow it, but nothing is judged by it. The value of a conjunct is +inf where no sample
decides it, such as G over a window that a trajectory cut short never reaches. Such a conjunct counts as much as the
best of the others, so that a trajectory gains nothing by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TOLD = ("robustness", "leximin")


@dataclass(frozen=True)
class Scores:
    """The scores of N sampled trajectories.

    Attributes:
      returns: R_i, shape (N,). -inf is allowed (no trajectory is worse); NaN and +inf are not.
      rewards: r_{i,t}, shape (N, T); None where the reward is not known per step.
    """

    returns: Array
    rewards: Array | None = None


def check_returns(returns: Array) -> None:
    """Checks that a learner can learn from returns (..., N), each leading index a problem of its own.

    Raises:
      ValueError: if one is NaN or +inf (naming the samples), or all of a problem are -inf.
    """
    wrong = np.isnan(returns) | (returns == np.inf)
    if wrong.any():
        samples = np.unique(np.nonzero(wrong)[-1]).tolist()
        raise ValueError(f"the returns of samples {samples} are NaN or +inf: no policy can be learned from them")
    if (returns == -np.inf).all(axis=-1).any():
        raise ValueError("every return is -inf: no sample is better than another")


def leximin(conjuncts: Array) -> Array:
    """The leximin surrogate L of each trajectory, shape (N,).

    Args:
      conjuncts: robustness of every conjunct of the spec, shape (N, C), in the predicates' unit; L is -inf where
        one of them is, and +inf where all are +inf.
    """
    decided = conjuncts < np.inf
    best = np.max(conjuncts, axis=1, keepdims=True, where=decided, initial=-np.inf)
    values = np.where(decided | ~decided.any(axis=1, keepdims=True), conjuncts, best)
    in_order = np.ascontiguousarray(np.sort(values, axis=1))  # otherwise the last digit depends on the memory layout
    return np.asarray(in_order @ 0.5 ** np.arange(values.shape[1]))
