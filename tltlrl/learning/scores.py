"""What a learner is told of a trajectory: its return, and where they are known the rewards of its steps.

The published return of a trajectory is the robustness of the spec, which is the value of its worst clause. The leximin
surrogate tells two trajectories apart that fail at the same clause: the values of the clauses, sorted from the worst
c_(0) <= c_(1) <= ..., are weighed by the powers of a half,

    L = sum_k 2^-k c_(k)

It is a continuous surrogate of the leximin order, not that order itself, and its sign is not the spec's: a learner may
follow it, and nothing is judged by it. A clause that nothing decides is worth +inf (G over a window that a trajectory
cut short never reaches); it counts as much as the best of the clauses that something decides, so that it wins nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TOLD = ("robustness", "leximin")


@dataclass(frozen=True)
class Scores:
    """What a learner is told of N sampled trajectories.

    Attributes:
      returns: R_i, shape (N,). -inf is allowed (it cannot be worse); NaN and +inf are not.
      rewards: r_{i,t}, shape (N, T), where the reward is known per step; otherwise None.
    """

    returns: Array
    rewards: Array | None = None


def leximin(clauses: Array) -> Array:
    """The surrogate L of each trajectory, shape (N,).

    Args:
      clauses: robustness of every top-level clause of the spec, shape (N, C), in the predicates' unit; L is -inf where
        one of them is, and +inf where all are +inf.
    """
    decided = clauses < np.inf
    best = np.max(clauses, axis=1, keepdims=True, where=decided, initial=-np.inf)
    clauses = np.where(decided | ~decided.any(axis=1, keepdims=True), clauses, best)
    in_order = np.ascontiguousarray(np.sort(clauses, axis=1))  # else the last digit depends on how it lies in memory
    return np.asarray(in_order @ 0.5 ** np.arange(clauses.shape[1]))
