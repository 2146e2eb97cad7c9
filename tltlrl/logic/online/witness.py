"""What decides the robustness of a trajectory that still runs, as in `tltlrl.logic.explain`, but without its past.

min and max select, so the value of each state is that of one literal at one step. This origin is passed on with the
value from state to state. In clauses that are read as slices, the literal is found by its value alone: where several
samples have the same value, the first of them is named.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from tltlrl.logic.explain import Explanation, explain
from tltlrl.logic.graph import BEGUN, Array, Op
from tltlrl.logic.meaning import Meaning, Truth
from tltlrl.logic.online.monitor import Monitor, Reading
from tltlrl.logic.online.pursuit import Late, Quick


@dataclass(frozen=True, slots=True, eq=False)
class Origin:
    """A literal at a step."""

    literal: int
    step: int
    sample: Mapping[tuple[str, int | None], Array]  # (1, 1) each


class Witnessed:
    """A monitor of one trajectory that can say what decides."""

    def __init__(self, monitor: Monitor, meaning: Meaning, source: str) -> None:
        self._monitor, self._meaning, self._source = monitor, meaning, source
        self._arrows = [p.together.transitions for p in monitor.pursuits if isinstance(p, Quick)]
        self._of_state: dict[int, Origin] = {}  # of the quick clauses' states; none where the value is infinite
        self._of_value: dict[float, Origin] = {}  # what slow clauses keep
        self._truths = _truths(meaning.formula)
        self._value = np.nan  # the robustness now
        # What looks back, or is true or false, is explained by the whole past.
        ops = meaning.graph.ops
        self._needs_past = meaning.looks_back or any(map(_is_crisp, ops)) or monitor.reads_whole
        self._past: list[Mapping[tuple[str, int | None], Array]] = []

    @property
    def steps(self) -> int:
        """Samples read so far."""
        return self._monitor.steps

    @property
    def monitor(self) -> Monitor:
        """The monitor that it asks."""
        return self._monitor

    def update(self, signals: Mapping[str, ArrayLike]) -> Reading:
        """One more sample, as `Monitor.update`."""
        before = {id(pursuit): pursuit.alpha for pursuit in self._monitor.pursuits}
        reading = self._monitor.update(signals)
        sample = {
            (name, None if d is None else i): np.reshape(signals[name], -1)[i : i + 1, None].astype(float)
            for name, d in self._meaning.signals.items()
            for i in range(d or 1)
        }
        if self._needs_past:
            self._past.append(sample | {BEGUN: np.array([[np.inf]])})
        now = {row: Origin(literal, self.steps - 1, sample) for row, literal in self._monitor.atom_rows().items()}
        for pursuit in self._monitor.pursuits:
            if isinstance(pursuit, Quick):
                self._follow(pursuit, before[id(pursuit)], now)
            else:
                for row, origin in now.items():
                    self._of_value.setdefault(float(self._monitor.literals[row, 0]), origin)
        self._value = float(reading.robustness[0]) + 0.0
        if reading.state is not None and self._of_value:
            kept = {*reading.state[0].tolist(), self._value}
            self._of_value = {own: origin for own, origin in self._of_value.items() if own in kept}
        return reading

    def _follow(self, quick: Quick, before: Array, now: Mapping[int, Origin]) -> None:
        """Give each state the origin of the transition that gave it its value."""
        literals = self._monitor.literals[:, 0]
        found: dict[int, Origin] = {}
        for source, rows, target in self._arrows[0]:  # there is one at most
            value = quick.alpha[target, 0]
            if target in found or not np.isfinite(value):
                continue
            deciding = min(rows, key=lambda row: literals[row])
            if min(before[source, 0], literals[deciding]) != value:
                continue
            if before[source, 0] == value and source in self._of_state:
                found[target] = self._of_state[source]
            elif literals[deciding] == value:
                found[target] = now[deciding]
        self._of_state = found

    def explanation(self) -> Explanation:
        """What decides the robustness after the last sample."""
        value = self._value
        if self._needs_past:
            whole = {key: np.concatenate([one[key] for one in self._past], axis=1) for key in self._past[0]}
            return explain(replace(self._meaning, definitions={}), self._source, whole)
        origin = None if np.isinf(value) else self._origin(value)
        if origin is None:
            return Explanation(value, None, None, self._source, None, None, self.steps - 1, None, False, {})
        node, sign = self._monitor.atom(origin.literal)
        meaning = replace(self._meaning, formula=self._truths[node], root=node, definitions={})
        why = explain(meaning, self._source, origin.sample)
        return replace(why, value=value, step=origin.step, negated=why.negated == sign)

    def _origin(self, value: float) -> Origin:
        for pursuit in self._monitor.pursuits:
            if isinstance(pursuit, Late):
                continue
            for offset, one in zip(pursuit.together.offsets, pursuit.together.automata, strict=True):
                ending = [offset + state for state in one.ending()]
                if max((pursuit.alpha[state, 0] for state in ending), default=-np.inf) == value:
                    return next(self._of_state[state] for state in ending if pursuit.alpha[state, 0] == value)
        return self._of_value[value]


def _is_crisp(op: Op) -> bool:
    """Whether it is true or false, +inf or -inf, of itself and not because a trajectory ends."""
    return op.name == "holds" or (op.name == "constant" and op.data in {(np.inf,), (-np.inf,)})


def _truths(formula: Truth) -> dict[int, Truth]:
    """The formula of each node, named by the innermost named sub-formula that it is part of."""
    found: dict[int, Truth] = {}
    stack = [formula]
    while stack:
        truth = stack.pop()
        if truth.node not in found:
            found[truth.node] = truth
            stack.extend(part if part.name else replace(part, name=truth.name) for part in truth.parts)
    return found
