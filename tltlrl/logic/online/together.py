"""Automata that step together, on one array of states of N trajectories.

What a step costs is the number of NumPy calls, not of numbers. So whatever is alike is one array: all guards, all
transitions, all states that are looked at.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic.graph import Array
from tltlrl.logic.online.automaton import Automaton, Guard

Indices = NDArray[np.intp]
_MOST_FILLING = 4  # of a table of groups, per member


@dataclass(frozen=True, slots=True)
class Groups:
    """Groups of rows of an array, each of which is folded to one.

    Attributes:
      rows: one column per group, the shorter ones filled up; where that would be mostly filling, one after the other.
      starts: where each group begins, if they stand one after the other.
    """

    rows: Indices
    starts: Indices | None

    @staticmethod
    def of(groups: Sequence[Sequence[int]], filling: int) -> "Groups":
        """Groups, `filling` being a row that changes nothing."""
        sizes = [len(group) for group in groups]
        longest = max(sizes)
        if longest * len(groups) <= _MOST_FILLING * sum(sizes):
            columns = [[*group, *[filling] * (longest - len(group))] for group in groups]
            return Groups(np.array(columns, np.intp).T.copy(), None)
        return Groups(np.array([row for one in groups for row in one], np.intp), np.cumsum([0, *sizes[:-1]]))

    def map(self, function: Callable[[Indices], Indices]) -> "Groups":
        """The groups with other rows."""
        return Groups(function(self.rows), self.starts)

    def fold(self, ufunc: np.ufunc, array: Array) -> Array:
        """One row per group of an array."""
        return self.folded(ufunc, array.take(self.rows, axis=0))

    def folded(self, ufunc: np.ufunc, values: Array) -> Array:
        """One row per group, from the values at `rows`."""
        if self.starts is not None:
            return ufunc.reduceat(values, self.starts, axis=0)
        return ufunc.reduce(values, axis=0)


@dataclass(frozen=True)
class Together:
    """Some automata as one list of transitions. Numbers are rows of arrays (rows, N).

    Row 0 of the literals is +inf, the guard that asks for nothing; row 0 of the states is -inf, the state that nobody
    is in.

    Attributes:
      automata: that it holds.
      offsets: the number of each one's first state.
      count: of states.
      transitions: from which state, with which literals, to which; ordered by where they lead.
      guards: groups of literals; None if each is of one literal.
      sources: of the transitions into each state, the states that they come from.
      asked: of the same transitions, their guards, or their literals.
    """

    automata: tuple[Automaton, ...]
    offsets: tuple[int, ...]
    count: int
    transitions: tuple[tuple[int, tuple[int, ...], int], ...]
    guards: Groups | None
    sources: Groups
    asked: Indices

    @staticmethod
    def of(automata: Iterable[Automaton], literals: tuple[int, ...]) -> "Together":
        """Put automata together whose guards hold some literals."""
        own = tuple(automata)
        row = {literal: i for i, literal in enumerate(literals, start=1)}
        sizes = [len(a.states) for a in own]
        offsets = tuple(1 + sum(sizes[:i]) for i in range(len(own)))
        count = 1 + sum(sizes)
        arrows = [(b + o, a + o, guard) for o, one in zip(offsets, own, strict=True) for a, guard, b in one.transitions]
        arrows.sort(key=lambda arrow: arrow[:2])
        guards: dict[Guard, int] = {frozenset(): 0}
        for _, _, guard in arrows:
            guards.setdefault(guard, len(guards))
        lists = {guard: tuple(sorted(row[literal] for literal in guard)) or (0,) for guard in guards}
        # From row 0 a way leads into every state that has no other, so that each has one.
        ways = [(0, 0), *((a, guards[guard]) for _, a, guard in arrows)]
        into: list[list[int]] = [[] for _ in range(count)]
        for i, (b, _, _) in enumerate(arrows, start=1):
            into[b].append(i)
        incoming = Groups.of([group or [0] for group in into], 0)
        sources, asked = np.array(ways, np.intp).T
        is_single = all(len(rows) == 1 for rows in lists.values())
        if is_single:
            asked = np.array([rows[0] for rows in lists.values()])[asked]
        return Together(
            own,
            offsets,
            count,
            tuple((a, lists[guard], b) for b, a, guard in arrows),
            None if is_single else Groups.of(list(lists.values()), 0),
            incoming.map(lambda rows: sources[rows]),
            asked[incoming.rows],
        )

    @cached_property
    def nearing(self) -> Groups:
        """For each automaton and each distance d >= 1 of its states from its end: the states at most that far."""
        groups = []
        for offset, one in zip(self.offsets, self.automata, strict=True):
            far = one.distances()
            for d in sorted({own for own in far if 0 < own < np.inf}):
                groups.append([offset + state for state, own in enumerate(far) if own <= d])
        return Groups.of(groups or [[0]], 0)

    def start(self, count: int) -> Array:
        """The states' values before the first sample, (states, N)."""
        alpha = np.full((self.count, count), -np.inf)
        alpha[list(self.offsets)] = np.inf
        return alpha

    def step(self, alpha: Array, literals: Array) -> Array:
        """The states' values after one more sample, whose literals are (1 + literals, N)."""
        guards = literals if self.guards is None else self.guards.fold(np.minimum, literals)
        ways = alpha.take(self.sources.rows, axis=0)
        np.minimum(ways, guards.take(self.asked, axis=0), out=ways)
        return self.sources.folded(np.maximum, ways)


@dataclass(frozen=True, slots=True)
class Summary:
    """Which states are looked at for robustness, lower and upper bound.

    Each is the minimum over as many groups of the maximum over the states of a group.
    """

    groups: Groups

    @staticmethod
    def of(together: Together, never: frozenset[int], forever: frozenset[int]) -> "Summary":
        """Where some literals will be -inf from now on, others +inf."""
        kinds: tuple[list[list[int]], ...] = ([], [], [])
        for offset, one in zip(together.offsets, together.automata, strict=True):
            sets = ([one.ending()], one.secured(forever), [one.hopeful(never)])
            for kind, own in zip(kinds, sets, strict=True):
                kind.extend([offset + state for state in sorted(states)] or [0] for states in own)
        most = max(map(len, kinds))
        full = [kind + kind[:1] * (most - len(kind)) for kind in kinds]
        return Summary(Groups.of([group for three in zip(*full, strict=True) for group in three], 0))

    def read(self, alpha: Array) -> tuple[Array, Array, Array]:
        """Robustness, lower and upper bound, (N,) each."""
        values = self.groups.fold(np.maximum, alpha)
        least = np.minimum.reduce(values.reshape(-1, 3, alpha.shape[1]), axis=0)
        return least[0], least[1], least[2]
