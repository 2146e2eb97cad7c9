"""CMA-ES (Hansen 2016, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772), with pycma's update.

CMA-ES learns one covariance of all offsets, across steps too, so it works best with few of them: weights of basis
functions (`algorithm.basis`). Only the order of the returns counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.learning.learner import Diagnostics
from tltlrl.learning.policy import Policy
from tltlrl.learning.scores import Scores, check_returns

Array = NDArray[np.float64]
MOST_DIMENSIONS = 300  # one update takes a second there; with ten times as many it takes a thousand


@dataclass(frozen=True)
class CmaSettings:
    """No settings: pycma's defaults follow from the dimension and the number of samples."""


@dataclass(frozen=True)
class CmaState:
    """The search distribution over x, where offsets are start + scale x: x ~ N(mean, step_size^2 C).

    Attributes:
      gain, start, correlation: of the first policy; its mean is `start`, shape (T, d).
      scale: standard deviations of the first policy's offsets, shape (d,).
      mean: shape (T d,).
      step_size: sigma.
      covariance: C, shape (T d, T d).
      path, step_path: the evolution paths p_c and p_sigma, shape (T d,).
      evaluations: trajectories told so far.
    """

    gain: Array
    start: Array
    correlation: float
    scale: Array
    mean: Array
    step_size: float
    covariance: Array
    path: Array
    step_path: Array
    evaluations: int


class CmaEs:
    """CMA-ES: one search distribution over all offsets."""

    Settings: ClassVar[type] = CmaSettings
    by_step: ClassVar[bool] = False
    packages: ClassVar[tuple[str, ...]] = ("cma",)

    def __init__(self, settings: CmaSettings, samples: int) -> None:  # noqa: ARG002
        try:
            from cma.more_algorithms import purecma
        except ImportError as error:
            raise UserError(
                "cases: CMA-ES needs the package pycma; install tltlrl with it: pip install 'tltlrl[cma]'"
            ) from error
        if samples < 4:
            raise UserError(f"algorithm.samples: {samples} are too few for CMA-ES; it needs at least 4")
        self._purecma: Any = purecma

    def start(self, policy: Policy) -> CmaState:
        """The first policy's offsets, independent of each other; the correlation of its noise is not used.

        Raises:
          UserError: if T d is above `MOST_DIMENSIONS`.
        """
        n = policy.mean.size
        if n > MOST_DIMENSIONS:
            raise UserError(
                f"algorithm.basis: CMA-ES learns a covariance of all {n} offsets of a motion, and {MOST_DIMENSIONS} "
                "are the most; let it learn the weights of basis functions, for instance algorithm.basis=20"
            )
        return CmaState(
            gain=policy.gain,
            start=policy.mean,
            correlation=policy.correlation,
            scale=np.sqrt(np.diagonal(policy.covariance[0])),
            mean=np.zeros(n),
            step_size=1.0,
            covariance=np.eye(n),
            path=np.zeros(n),
            step_path=np.zeros(n),
            evaluations=0,
        )

    def ask(self, state: CmaState, count: int, rng: np.random.Generator) -> Array:
        """Offsets drawn from the search distribution, shape (count, T, d)."""
        values, vectors = np.linalg.eigh(state.covariance)
        noise = rng.standard_normal((count, len(values))) * np.sqrt(values)
        x = state.mean + state.step_size * noise @ vectors.T
        return np.asarray(state.start + x.reshape(count, *state.start.shape) * state.scale)

    def tell(self, state: CmaState, offsets: Array, scores: Scores) -> tuple[CmaState, Diagnostics]:
        """The search distribution after pycma's update.

        Raises:
          ValueError: if a return is NaN or +inf, or every one is -inf.
        """
        check_returns(scores.returns)
        x = ((offsets - state.start) / state.scale).reshape(len(offsets), -1)
        search = self._purecma.CMAES(state.mean.tolist(), state.step_size, popsize=len(offsets))
        search.pc, search.ps, search.counteval = state.path.tolist(), state.step_path.tolist(), state.evaluations
        values, vectors = np.linalg.eigh(state.covariance)
        for i, row in enumerate(state.covariance.tolist()):
            search.C[i] = row
        search.C.eigenvalues, search.C.eigenbasis = values.tolist(), vectors.tolist()
        search.C.invsqrt = ((vectors / np.sqrt(values)) @ vectors.T).tolist()
        search.C.updated_eval = state.evaluations
        search.tell(x.tolist(), (-scores.returns).tolist())
        following = replace(
            state,
            mean=np.array(search.xmean),
            step_size=float(search.sigma),
            covariance=np.array([list(row) for row in search.C]),
            path=np.array(search.pc),
            step_path=np.array(search.ps),
            evaluations=int(search.counteval),
        )
        diagnostics = {
            "step_size": float(state.step_size),
            "condition_number": float(values[-1] / values[0]),
            "entropy": self.policy(state).entropy(),
        }
        return following, diagnostics

    def policy(self, state: CmaState) -> Policy:
        """The mean, and the covariance of each step's own offsets."""
        steps, d = state.start.shape
        blocks = state.covariance.reshape(steps, d, steps, d)[np.arange(steps), :, np.arange(steps), :]
        covariance = state.step_size**2 * blocks * np.outer(state.scale, state.scale)
        return Policy(
            state.gain, state.start + state.mean.reshape(steps, d) * state.scale, covariance, state.correlation
        )
