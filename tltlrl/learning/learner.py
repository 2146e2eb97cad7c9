"""The contract of a learner: start, ask, tell, policy.

A learner is made from its own settings and the number of samples per iteration. It keeps no state: the caller holds it
and hands it back. So a run can be stopped and resumed between any two iterations, and the state is the checkpoint.

    learner = EpisodeBased(RepsSettings(epsilon=1.0), samples=20)
    state = learner.start(policy)
    offsets = learner.ask(state, 20, rng)
    state, diagnostics = learner.tell(state, offsets, Scores(returns))

A learner knows no task, spec or file.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.learning.scores import Scores

Array = NDArray[np.float64]
Diagnostics = dict[str, float]  # the learner's own columns of progress.csv
State = TypeVar("State")


class Learner(Protocol[State]):
    """How a policy is improved.

    Attributes:
      Settings: dataclass of the learner's own keys in the config group `algorithm`; each has a default.
      by_step: whether it needs `Scores.rewards`.
      packages: installed packages whose versions decide its numbers, besides NumPy; may be missing.

    `State` is a frozen dataclass of arrays and numbers.
    """

    Settings: ClassVar[type]
    by_step: ClassVar[bool]

    def __init__(self, settings: Any, samples: int) -> None:
        """Makes the learner from its own settings.

        Raises:
          UserError: if the settings do not fit that many samples per iteration; it names the key.
        """

    def start(self, policy: Policy) -> State:
        """The state before the first iteration, from the first policy."""

    def ask(self, state: State, count: int, rng: np.random.Generator) -> Array:
        """Offsets delta_{i,t} = u_{i,t} - K s_{i,t} to be tried, shape (count, T, d)."""

    def tell(self, state: State, offsets: Array, scores: Scores) -> tuple[State, Diagnostics]:
        """The next state, learned from the scores of the offsets that were tried.

        Args:
          state: the one that `ask` drew the offsets from.
          offsets: shape (N, T, d).
          scores: scores of the N trajectories.

        Raises:
          ValueError: if a return is NaN or +inf, or every one is -inf.
        """

    def policy(self, state: State) -> Policy:
        """The policy learned so far."""
