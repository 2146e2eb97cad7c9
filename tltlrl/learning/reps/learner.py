"""REPS as learners: episode-based and step-based differ in the weights alone.

Episode-based REPS solves one dual on the returns R_i; step-based REPS (Chebotar et al. 2017) one per time step on the
reward-to-go S_{i,t}. Both then fit the policy of every step to its weighted samples. The state is the policy itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.learning.learner import Diagnostics, Scores
from tltlrl.learning.policy import Policy
from tltlrl.learning.reps.dual import Weighting, solve_dual
from tltlrl.learning.reps.update import COVARIANCE_RULES, fit, reward_to_go
from tltlrl.settings import check, setting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RepsSettings:
    """Relative entropy policy search."""

    epsilon: float = setting("bound of the samples' KL per update, nats; below log(samples)", 1.0, above=0)
    covariance: str = setting(
        "damped, or published: the plain weighted maximum-likelihood fit", "damped", choices=COVARIANCE_RULES
    )
    kept: float = setting("share of the old covariance in the damped fit", 0.5, least=0, below=1)

    def __post_init__(self) -> None:
        check(self, "algorithm")


class _Reps:
    """What both have in common; `weighting` makes the difference."""

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

    def start(self, policy: Policy) -> Policy:
        """The first policy."""
        return policy

    def ask(self, state: Policy, count: int, rng: np.random.Generator) -> Array:
        """Offsets drawn from the policy, shape (count, T, d)."""
        return state.sample(count, rng)

    def weighting(self, scores: Scores) -> Weighting:
        """Weights of the samples: of shape (N,), or (T, N) if they differ from step to step."""
        raise NotImplementedError

    def tell(self, state: Policy, offsets: Array, scores: Scores) -> tuple[Policy, Diagnostics]:
        """The fitted policy.

        Of step-based REPS eta is the median over the steps, kl and effective_sample_size are means.

        Raises:
          ValueError: if a return is NaN or +inf, or every one is -inf.
        """
        weighting = self.weighting(scores)
        weights = np.broadcast_to(weighting.weights, (offsets.shape[1], len(offsets)))
        mean, covariance = fit(
            offsets, weights, state.mean, state.covariance, self.settings.covariance, self.settings.kept
        )
        diagnostics = {
            "eta": float(np.median(weighting.eta)),
            "kl": float(np.mean(weighting.kl)),
            "effective_sample_size": float(np.mean(weighting.effective_sample_size)),
            "entropy": state.entropy(),
        }
        return replace(state, mean=mean, covariance=covariance), diagnostics

    def policy(self, state: Policy) -> Policy:
        """The state itself."""
        return state


class EpisodeBased(_Reps):
    """Episode-based REPS: one weight per trajectory, from its return."""

    by_step = False

    def weighting(self, scores: Scores) -> Weighting:
        """p_i, shape (N,)."""
        return solve_dual(scores.returns, self.settings.epsilon)


class StepBased(_Reps):
    """Step-based REPS: one weight per trajectory and step, from the reward-to-go."""

    by_step = True

    def weighting(self, scores: Scores) -> Weighting:
        """P_{i,t}, shape (T, N).

        Raises:
          ValueError: if the rewards of the steps are not known.
        """
        if scores.rewards is None:
            raise ValueError("step-based REPS needs the rewards of every step")
        return solve_dual(reward_to_go(scores.rewards).T, self.settings.epsilon)
