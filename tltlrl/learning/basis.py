"""Basis functions: a few weights per command make a motion, with any episode-based learner.

The offsets are those of the first policy plus a weighted sum of K normalised radial basis functions,

    k_t = k_t^0 + sum_k B_{t,k} w_k        B_{t,k} = phi_k(t) / sum_j phi_j(t)

with Gaussians phi_k whose centres lie evenly over the T steps and whose width is the distance between two
neighbours. The learner beneath sees the weights as the offsets of K steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.learner import Diagnostics, Learner
from tltlrl.learning.policy import Policy
from tltlrl.learning.scores import Scores

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BasisState:
    """The first policy, and what the learner beneath knows of the weights.

    Attributes:
      gain, mean, covariance, correlation: of the first policy.
      weights: the learner's state.
    """

    gain: Array
    mean: Array
    covariance: Array
    correlation: float
    weights: Any


class Basis:
    """Makes a learner of offsets from a learner of the weights of basis functions.

    Args:
      learner: learns the weights. It must not need rewards per step, because a weight belongs to no step.
      functions: K, the number of basis functions.
    """

    Settings: ClassVar[type] = type(None)  # the learner beneath has them
    by_step: ClassVar[bool] = False

    def __init__(self, learner: Learner[Any], functions: int) -> None:
        self._learner, self._functions = learner, functions

    def start(self, policy: Policy) -> BasisState:
        """The state before the first iteration: weights of zero, which give the first policy.

        The weights' covariance is the policy's at its first step, scaled so that offsets vary as much on average.
        """
        basis = radial_basis(len(policy.mean), self._functions)
        spread = policy.covariance[0] / np.mean(np.sum(basis**2, axis=1))
        d = policy.mean.shape[1]
        weights = Policy(policy.gain, np.zeros((self._functions, d)), np.tile(spread, (self._functions, 1, 1)))
        return BasisState(policy.gain, policy.mean, policy.covariance, policy.correlation, self._learner.start(weights))

    def ask(self, state: BasisState, count: int, rng: np.random.Generator) -> Array:
        """Offsets from the weights that the learner beneath asks for, shape (count, T, d)."""
        basis = radial_basis(len(state.mean), self._functions)
        return np.asarray(state.mean + basis @ self._learner.ask(state.weights, count, rng))

    def tell(self, state: BasisState, offsets: Array, scores: Scores) -> tuple[BasisState, Diagnostics]:
        """Passes the weights of these offsets, with their scores, to the learner beneath.

        Raises:
          ValueError: if the learner beneath raises it.
        """
        basis = radial_basis(len(state.mean), self._functions)
        weights, diagnostics = self._learner.tell(
            state.weights, _inverse(*basis.shape) @ (offsets - state.mean), scores
        )
        return BasisState(state.gain, state.mean, state.covariance, state.correlation, weights), diagnostics

    def policy(self, state: BasisState) -> Policy:
        """The offsets of the mean weights, and at each step the covariance that the weights give."""
        basis = radial_basis(len(state.mean), self._functions)
        weights = self._learner.policy(state.weights)
        covariance = np.einsum("tk,kij->tij", basis**2, weights.covariance)
        return Policy(state.gain, state.mean + basis @ weights.mean, covariance, state.correlation)


@lru_cache(maxsize=8)
def _inverse(steps: int, functions: int) -> Array:
    """The pseudo-inverse of B, shape (K, T): offsets made of the functions => their weights."""
    return np.asarray(np.linalg.pinv(radial_basis(steps, functions)))


def radial_basis(steps: int, functions: int) -> Array:
    """B, shape (T, K); each row sums to 1."""
    centres = np.linspace(0, steps - 1, functions)
    width = (steps - 1) / max(functions - 1, 1)
    phi = np.exp(-0.5 * ((np.arange(steps)[:, None] - centres) / width) ** 2)
    return np.asarray(phi / phi.sum(axis=1, keepdims=True))
