"""The cross-entropy method as a learner for tltlrl: each policy is fitted to the best samples of the one before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tltlrl.errors import UserError
from tltlrl.learning.learner import Array, Diagnostics
from tltlrl.learning.policy import Policy
from tltlrl.learning.scores import Scores
from tltlrl.settings import check, setting


@dataclass(frozen=True)
class CemSettings:
    """What `tltl-run ... cases=[tltl_cem] algorithm.elite=0.3` can change."""

    elite: float = setting("share of the samples that the next policy is fitted to", 0.25, above=0, most=1)
    smoothing: float = setting("share of the old standard deviations in the new ones", 0.5, least=0, below=1)

    def __post_init__(self) -> None:
        check(self, "algorithm")


class CrossEntropy:
    """The state is the policy itself; its covariances stay diagonal."""

    Settings: ClassVar[type] = CemSettings
    by_step: ClassVar[bool] = False  # it looks at returns alone

    def __init__(self, settings: CemSettings, samples: int) -> None:
        self.settings = settings
        self.elite = round(settings.elite * samples)
        if self.elite < 2:
            raise UserError(
                f"algorithm.elite: {settings.elite} of {samples} samples are fewer than two; raise it, or draw more"
            )

    def start(self, policy: Policy) -> Policy:
        return policy

    def ask(self, state: Policy, count: int, rng: np.random.Generator) -> Array:
        return state.sample(count, rng)

    def tell(self, state: Policy, offsets: Array, scores: Scores) -> tuple[Policy, Diagnostics]:
        returns = scores.returns
        if (wrong := np.flatnonzero(np.isnan(returns) | (returns == np.inf))).size:
            raise ValueError(f"the return of trajectory {wrong[0]} is {returns[wrong[0]]}")
        if np.all(returns == -np.inf):
            raise ValueError("every return is -inf")
        best = np.argsort(-returns, kind="stable")[: self.elite]
        best = best[np.isfinite(returns[best])]
        spread = np.sqrt(np.diagonal(state.covariance, axis1=1, axis2=2))  # (T, d)
        kept = self.settings.smoothing
        spread = kept * spread + (1 - kept) * offsets[best].std(axis=0)
        covariance = spread[:, :, None] ** 2 * np.eye(offsets.shape[2])
        diagnostics = {"elite_return": float(returns[best].mean()), "spread": float(spread.mean())}
        return replace(state, mean=offsets[best].mean(axis=0), covariance=covariance), diagnostics

    def policy(self, state: Policy) -> Policy:
        return state
