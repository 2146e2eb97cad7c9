"""REPS as two learners, episode-based and step-based, which differ only in their weights.

Episode-based REPS solves one dual on the returns R_i. Step-based REPS (Chebotar et al. 2017) solves one dual per time
step on the reward-to-go S_{i,t}. Both then fit the policy of every step to its weighted samples.

An update may learn from the last few batches of samples together. It uses no importance weights: over all
steps they differ by so many nats that one sample would take all the weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.learning.learner import Diagnostics
from tltlrl.learning.policy import Policy
from tltlrl.learning.reps.dual import solve_dual
from tltlrl.learning.reps.update import COVARIANCE_RULES, fit, reward_to_go
from tltlrl.learning.scores import Scores
from tltlrl.settings import Role, check, setting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RepsSettings:
    """Settings of relative entropy policy search (REPS)."""

    epsilon: float = setting("bound of the samples' KL per update, nats; below log(samples)", 1.0, above=0)
    covariance: str = setting(
        "damped, or published: the plain weighted maximum-likelihood fit", "damped", choices=COVARIANCE_RULES
    )
    kept: float = setting("share of the old covariance in the damped fit", 0.5, least=0, below=1)
    batches: int = setting(
        "batches of samples that an update learns from; 1: the newest alone, as published",
        1,
        least=1,
        most=100,
        role=Role.LATER,
    )

    def __post_init__(self) -> None:
        check(self, "algorithm")


@dataclass(frozen=True)
class RepsState:
    """The policy, and the samples of earlier batches that the next update learns from.

    Attributes:
      gain, mean, covariance, correlation: of the policy.
      offsets: offsets of the last `batches` - 1 batches, the oldest first, shape (M, T, d).
      scores: their returns, shape (M), or rewards-to-go, shape (M, T).
    """

    gain: Array
    mean: Array
    covariance: Array
    correlation: float
    offsets: Array
    scores: Array


class _Reps:
    """The common part of both learners, which differ in `worth`."""

    Settings: ClassVar[type] = RepsSettings
    by_step: ClassVar[bool]

    def __init__(self, settings: RepsSettings, samples: int) -> None:
        bound = math.log(samples)
        if settings.epsilon >= bound:
            raise UserError(
                f"algorithm.epsilon: {settings.epsilon} must lie between 0 and log(algorithm.samples) = {bound:.3f}: "
                f"the weights of {samples} samples cannot be further from uniform. Lower it, or draw more samples."
            )
        self.settings = settings
        self._remembered = (settings.batches - 1) * samples

    def start(self, policy: Policy) -> RepsState:
        """The state before the first iteration: the first policy, and no samples."""
        steps, d = policy.mean.shape
        scores = np.empty((0, steps) if self.by_step else 0)
        return RepsState(
            policy.gain, policy.mean, policy.covariance, policy.correlation, np.empty((0, steps, d)), scores
        )

    def ask(self, state: RepsState, count: int, rng: np.random.Generator) -> Array:
        """Offsets drawn from the policy, shape (count, T, d)."""
        return self.policy(state).sample(count, rng)

    def worth(self, scores: Scores) -> Array:
        """The numbers that the dual weighs: one per trajectory, (N), or one per trajectory and step, (N, T)."""
        raise NotImplementedError

    def tell(self, state: RepsState, offsets: Array, scores: Scores) -> tuple[RepsState, Diagnostics]:
        """The state with the policy fitted to the weighted samples, and diagnostics.

        With step-based REPS, eta is the median over the steps; kl and effective_sample_size are means.

        Raises:
          ValueError: if a return is NaN or +inf, or every one is -inf.
        """
        entropy = self.policy(state).entropy()
        offsets = np.concatenate([state.offsets, offsets])
        worth = np.concatenate([state.scores, self.worth(scores)])
        weighting = solve_dual(worth.T, self.settings.epsilon)
        weights = np.broadcast_to(weighting.weights, (offsets.shape[1], len(offsets)))
        mean, covariance = fit(
            offsets, weights, state.mean, state.covariance, self.settings.covariance, self.settings.kept
        )
        diagnostics = {
            "eta": float(np.median(weighting.eta)),
            "kl": float(np.mean(weighting.kl)),
            "effective_sample_size": float(np.mean(weighting.effective_sample_size)),
            "entropy": entropy,
        }
        first = max(len(offsets) - self._remembered, 0)
        return replace(
            state, mean=mean, covariance=covariance, offsets=offsets[first:], scores=worth[first:]
        ), diagnostics

    def policy(self, state: RepsState) -> Policy:
        """The policy of a state."""
        return Policy(state.gain, state.mean, state.covariance, state.correlation)


class EpisodeBased(_Reps):
    """Episode-based REPS: one weight p_i per trajectory, from its return."""

    by_step = False

    def worth(self, scores: Scores) -> Array:
        """The returns R_i, shape (N)."""
        return scores.returns


class StepBased(_Reps):
    """Step-based REPS: one weight P_{i,t} per trajectory and step, from the reward-to-go."""

    by_step = True

    def worth(self, scores: Scores) -> Array:
        """The rewards-to-go S_{i,t}, shape (N, T).

        Raises:
          ValueError: if the rewards of the steps are not known.
        """
        if scores.rewards is None:
            raise ValueError("step-based REPS needs the rewards of every step")
        return reward_to_go(scores.rewards)
