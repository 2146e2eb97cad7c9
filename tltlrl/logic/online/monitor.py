"""Robustness while a trajectory runs: exact at every sample, with bounds on the final value.

docs/online.md describes the method and its proof.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tltlrl.logic.graph import Array
from tltlrl.logic.online.memory import Memory
from tltlrl.logic.online.pursuit import Compiled, Late, Quick, Whole
from tltlrl.logic.online.sheet import Sheet
from tltlrl.logic.online.together import Indices
from tltlrl.logic.semantics import Signals

# (sheet, memory, signals, step) -> signals as (N, 1), values of the memory's nodes
Sampler = Callable[[Sheet, Memory, Mapping[str, ArrayLike], int], tuple[Signals, Array]]


class Reading(NamedTuple):
    """What is known of N trajectories after a sample.

    Attributes:
      robustness: (N,), the robustness if they ended now.
      lower, upper: (N,), bounds on the robustness, however they go on.
      decided: (N,), whether the two bounds are equal.
      state: (N, M), all that later readings depend on, apart from later samples. It may hold infinities. None where
        the whole past is kept; see `Monitor.keeps_past`.
    """

    robustness: Array
    lower: Array
    upper: Array
    decided: NDArray[np.bool_]
    state: Array | None


class Monitor:
    """Robustness of `count` trajectories that run side by side; see `Spec.monitor`.

    Attributes:
      count: number of trajectories.
      steps: samples read so far.
      pursuits: what follows each part of the spec.
      literals: values of the literals at the last sample, (1 + literals, N).
    """

    def __init__(self, spec: Compiled, count: int, sample: Sampler) -> None:
        self.count, self._spec, self._sample = count, spec, sample
        self.restart()
        # Values that every step needs.
        self._rows = np.array([self._memory.rows[node] for node, _ in spec.values], np.intp)
        self._signs = np.array([[1.0 if sign else -1.0] for _, sign in spec.values])
        self._clocks = list(enumerate(spec.clocks.values(), start=1 + len(spec.atoms)))
        self._grows = self.keeps_past

    def restart(self) -> None:
        """Forgets all samples; the next one is the first of new trajectories."""
        self.steps = 0
        spec, slow = self._spec, [clause for clause in self._spec.clauses if clause.is_slow]
        self.literals = np.empty((0, self.count))
        self.pursuits: list[Quick | Late] = [Late(spec, clause, self.count) for clause in slow]
        self._memory = spec.memory(self.count)
        self._sheet = Sheet(self._memory.layout, self.count)
        self._whole = [Whole(spec.terms.source, node) for node in spec.others]
        if len(slow) < len(spec.clauses):
            self.pursuits.append(Quick(spec, self.count))

    @property
    def reads_whole(self) -> bool:
        """Whether a part of the spec is evaluated anew on all samples at every step, and has no bounds."""
        return bool(self._spec.others)

    @property
    def keeps_past(self) -> bool:
        """Whether all samples are kept: readings are exact all the same, but take longer as trajectories grow."""
        return self.reads_whole or any(clause.automaton is None for clause in self._spec.clauses)

    def atom_rows(self) -> dict[int, int]:
        """Which row of `literals` holds which literal, clocks left out."""
        return {row: one for row, one in enumerate(self._spec.literals, start=1) if one in self._spec.atoms}

    def atom(self, literal: int) -> tuple[int, bool]:
        """The node of the spec's graph that a literal reads, and False if it reads the negation."""
        return self._spec.atoms[literal]

    def keep(self, rows: Indices) -> None:
        """Follows only these trajectories from now on, in this order."""
        self.count = len(rows)
        self.literals = self.literals[:, rows]
        self._memory.keep(rows)
        self._sheet = Sheet(self._memory.layout, self.count)
        for part in (*self.pursuits, *self._whole):
            part.keep(rows)

    def update(self, signals: Mapping[str, ArrayLike]) -> Reading:
        """Reads one more sample.

        Args:
          signals: name => (N,) for a scalar, (N, d) for a vector; for one trajectory also a number or (d,).

        Raises:
          TraceError: as in `Spec.robustness`. The sample then counts as not read.
        """
        block, values = self._sample(self._sheet, self._memory, signals, self.steps)
        whole = [one.update(block) for one in self._whole]
        self._memory.remember(values)
        literals = self._read_literals(values)
        read = [pursuit.update(literals, self.steps) for pursuit in self.pursuits] + whole
        robustness, lower, upper = read[0] if len(read) == 1 else map(np.minimum.reduce, zip(*read, strict=True))
        self.steps += 1
        self.literals = literals
        return Reading(robustness, lower, upper, lower == upper, self._state())

    def _read_literals(self, values: Array) -> Array:
        """The values of the literals at this step, after a row of +inf, which stands for no literal."""
        literals = values.take(self._rows, axis=0)
        np.multiply(literals, self._signs, out=literals)
        for row, (low, high, inside) in self._clocks:
            literals[row] = np.inf if (low <= self.steps <= high) == inside else -np.inf
        return literals

    def _state(self) -> Array | None:
        if self._grows:
            return None
        parts = [part for pursuit in self.pursuits if (part := pursuit.state()) is not None]
        parts += [part[None] for part in self._memory.state()]
        if self._clocks:
            parts.append(np.full((1, self.count), float(self.steps)))
        return parts[0].copy().T if len(parts) == 1 else np.concatenate(parts).T
