"""The dual of relative entropy policy search: from returns to the weights of the samples.

Maximise E_p[R] subject to KL(p || q) <= epsilon, with q the N samples, uniform (Deisenroth, Neumann & Peters 2013, A
Survey on Policy Search for Robotics, section 2.4.3). The dual to minimise over the temperature eta > 0 is

    g(eta) = eta epsilon + R_max + eta log( (1/N) sum_i exp((R_i - R_max) / eta) )

and the weights are p_i proportional to exp((R_i - R_max) / eta). Since g'(eta) = epsilon - KL(p || uniform) and the KL
falls as eta rises, the KL equals the bound at the optimum. So one scalar root is sought, over log eta.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.scores import check_returns

Array = NDArray[np.float64]

LOWEST_TEMPERATURE = 1e-300  # in units of the returns' range: two best returns may lie that close
TOLERANCE = 1e-10  # of the KL, nats
ITERATIONS = 100  # bisection alone needs about 50 from end to end; Newton's steps about 5


@dataclass(frozen=True)
class Weighting:
    """The weights of N samples; leading axes are the same as in the returns (one dual per time step).

    Attributes:
      weights: p_i, shape (..., N), summing to 1.
      eta: temperature in units of the returns, shape (...). Infinite where all returns are equal (so are the
        weights); 0 where the bound does not bind and the best samples share all weight.
      kl: KL(p || uniform over the samples with a finite return), nats, shape (...); at most epsilon.
    """

    weights: Array
    eta: Array
    kl: Array

    @property
    def effective_sample_size(self) -> Array:
        """1 / sum_i p_i^2, between 1 and N."""
        return np.asarray(1.0 / np.sum(self.weights**2, axis=-1))


def solve_dual(returns: Array, epsilon: float) -> Weighting:
    """The weights of the samples that maximise the mean return under the bound `epsilon` on the KL.

    Returns are normalised by their range first, so that neither their scale nor their offset matters. A return of
    -inf (a sample that cannot be worse) gets weight 0 and does not count in the bound.

    Args:
      returns: R_i, shape (..., N); each leading index is a problem of its own.
      epsilon: bound on the KL, nats; positive.

    Raises:
      ValueError: if epsilon is not positive, if a return is NaN or +inf (naming the samples) or if all are -inf.
    """
    returns = np.asarray(returns, dtype=np.float64)
    if not epsilon > 0:
        raise ValueError(f"epsilon must be positive, not {epsilon}")
    check_returns(returns)
    finite = returns > -np.inf
    count = finite.sum(axis=-1, keepdims=True)
    size = np.max(np.abs(returns), axis=-1, keepdims=True, where=finite, initial=np.finfo(float).tiny)
    best = np.max(returns, axis=-1, keepdims=True)
    worst = np.min(returns, axis=-1, keepdims=True, where=finite, initial=np.inf)
    spread = best / size - worst / size  # divided first: the range itself may overflow
    with np.errstate(invalid="ignore"):
        scores = np.where(finite, (returns / size - best / size) / np.where(spread > 0, spread, 1.0), -np.inf)

    # Where the bound does not bind, the best samples share the weight. Where returns are equal, all are the best.
    ties = scores == 0.0
    greedy = np.log(count / ties.sum(axis=-1, keepdims=True)) <= epsilon
    log_eta = _root(np.where(greedy, np.where(ties, 0.0, -1.0), scores), count, epsilon, ~greedy)
    eta = np.exp(log_eta)
    with np.errstate(over="ignore"):
        unnormalised = np.where(greedy, ties, np.exp(scores / eta))
    weights = unnormalised / unnormalised.sum(axis=-1, keepdims=True)
    kl = np.sum(weights * np.log(np.maximum(weights * count, np.finfo(float).tiny)), axis=-1)
    temperature = np.where(greedy, np.where(spread > 0, 0.0, np.inf), eta * spread * size)[..., 0]
    return Weighting(weights, temperature, np.maximum(kl, 0.0))


def _root(scores: Array, count: Array, epsilon: float, active: NDArray[np.bool_]) -> Array:
    """log eta where KL(p(eta) || uniform) = epsilon, by Newton's method kept inside a shrinking bracket."""
    low = np.full(count.shape, np.log(LOWEST_TEMPERATURE))
    high = np.full(count.shape, -np.log(epsilon))  # log(p_i N) <= 1 / eta, so KL <= epsilon at eta = 1 / epsilon
    finite = np.isfinite(scores)
    finite_scores = np.where(finite, scores, 0.0)
    centred = np.where(finite, scores - finite_scores.sum(axis=-1, keepdims=True) / count, 0.0)
    deviation = np.sqrt((centred**2).sum(axis=-1, keepdims=True) / count)
    start = np.log(np.maximum(deviation, LOWEST_TEMPERATURE) / np.sqrt(2 * epsilon))  # KL ~ Var / 2 eta^2
    x = np.minimum(np.maximum(start, low), high)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(ITERATIONS):
            eta = np.exp(x)
            weights = np.exp(scores / eta)
            total = weights.sum(axis=-1, keepdims=True)
            weights /= total
            mean = (weights * finite_scores).sum(axis=-1, keepdims=True)
            excess = mean / eta - np.log(total / count) - epsilon
            if not (active & (np.abs(excess) > TOLERANCE)).any():
                break
            variance = (weights * (finite_scores - mean) ** 2).sum(axis=-1, keepdims=True)
            low, high = np.where(excess > 0, x, low), np.where(excess > 0, high, x)
            newton = x + excess * eta**2 / variance  # dKL / dlog eta = -Var(score) / eta^2
            x = np.where((newton > low) & (newton < high), newton, 0.5 * (low + high))
    return x
