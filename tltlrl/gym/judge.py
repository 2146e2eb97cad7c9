"""Judges N environments by a spec while they run: rewards, bounds on the robustness, and the monitors' states."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.logic import Spec
from tltlrl.logic.online.monitor import Reading
from tltlrl.logic.online.potential import finite, stages

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
REWARDS = ("telescoped", "final")
KNOWN = ("robustness", "lower", "upper")


class Judgement(NamedTuple):
    """The judgement of the last sample of N environments.

    Attributes:
      rewards: (N,), 0 at the first sample of an episode.
      state: (N, M), of the monitors, infinities as in `finite`, 0 for what is not known yet.
      known: robustness, lower and upper, (N,) each.
      verdicts: of each environment whose episode is over: is_success and decided_by.
    """

    rewards: Array
    state: Array
    known: dict[str, Array]
    verdicts: dict[int, dict[str, Any]]


def info_of(judged: Judgement) -> dict[str, Any]:
    """The `info` of a single environment."""
    return {name: float(values[0]) for name, values in judged.known.items()} | judged.verdicts.get(0, {})


class Judge:
    """Judges `count` environments by a spec. One monitor follows all episodes that began with the same call.

    Raises:
      UserError: if the reward does not exist, or the spec's monitor keeps the whole past.
    """

    def __init__(self, spec: Spec, reward: str, count: int = 1) -> None:
        if reward not in REWARDS:
            raise UserError(f"reward: no such reward {reward}{nearest(reward, REWARDS)}")
        if spec.monitor().keeps_past:
            raise UserError(
                f"spec: '{spec.formula}' needs the whole past, which no observation holds; expected a formula "
                "with shorter windows inside unbounded operators; see docs/online.md"
            )
        self._spec, self._telescoped, self._count = spec, reward == "telescoped", count
        self._running: list[_Episodes] = []

    def read(self, signals: Mapping[str, Array], begins: Mask, over: Mask) -> Judgement:
        """Reads one more sample of each environment.

        Args:
          signals: name => (N,) or (N, d).
          begins: (N,), whether the sample is the first of an episode; the episode before is forgotten.
          over: (N,), whether the sample is the last of an episode.
        """
        if begins.any():
            for episodes in self._running:
                episodes.leave(begins)
            self._running = [episodes for episodes in self._running if len(episodes.rows)]
            self._running.append(_Episodes(self._spec, np.flatnonzero(begins)))
        rewards, known = np.zeros(self._count), {name: np.empty(self._count) for name in KNOWN}
        states, verdicts = [], dict[int, dict[str, Any]]()
        for episodes in self._running:
            rows = episodes.rows
            reading = episodes.read({name: signals[name][rows] for name in self._spec.signals})
            for name in KNOWN:
                known[name][rows] = getattr(reading, name)
            assert reading.state is not None
            states.append(reading.state)
            last = over[rows]
            before, episodes.phi = episodes.phi, self._potential(episodes, reading, last)
            if episodes.steps > 1:
                rewards[rows] = episodes.phi - before
            for i in np.flatnonzero(last).tolist():
                verdicts[int(rows[i])] = episodes.verdict(i)
        state = np.empty((self._count, states[0].shape[1]))
        for episodes, own in zip(self._running, states, strict=True):
            state[episodes.rows] = own
        state[np.isnan(state)] = 0.0
        return Judgement(rewards, finite(state), known, verdicts)

    def _potential(self, episodes: "_Episodes", reading: Reading, last: Mask) -> Array:
        phi = stages(episodes.monitor, reading) if self._telescoped else np.zeros(len(last))
        return np.where(last, finite(reading.robustness), phi)


class _Episodes:
    """Episodes that began together, of the environments `rows`."""

    def __init__(self, spec: Spec, rows: NDArray[np.intp]) -> None:
        self.rows, self.monitor, self.phi = rows, spec.monitor(len(rows)), np.zeros(len(rows))
        self._spec = spec
        self._seen: list[dict[str, Array]] = []  # every sample, to tell at the end what decided

    @property
    def steps(self) -> int:
        return self.monitor.steps

    def read(self, signals: dict[str, Array]) -> Reading:
        self._seen.append(signals)
        return self.monitor.update(signals)

    def leave(self, gone: Mask) -> None:
        """Stops following some environments."""
        (kept,) = np.nonzero(~gone[self.rows])
        if len(kept) < len(self.rows):
            self.rows, self.phi = self.rows[kept], self.phi[kept]
            self.monitor.keep(kept)
            self._seen = [{name: values[kept] for name, values in sample.items()} for sample in self._seen]

    def verdict(self, i: int) -> dict[str, Any]:
        """The verdict on the i-th environment."""
        path = {name: np.stack([sample[name][i] for sample in self._seen])[None] for name in self._spec.signals}
        (why,) = self._spec.explain(path)
        return {"is_success": bool(why.satisfied), "decided_by": why.decided_by}
