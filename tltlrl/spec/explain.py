"""Which predicate, at which step, decides a robustness value."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from tltlrl.spec.graph import Array, Op
from tltlrl.spec.resolve import Meaning
from tltlrl.spec.semantics import Signals, Values, plan


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why one trajectory has its robustness.

    min and max select: the value of a formula is the margin of one predicate at one step, with its sign
    turned once per negation on the way (`negated`: an odd number of times): `value == -margin if negated
    else margin`, exactly. When the end of the trajectory decides (X at the last sample, a T without a
    second sample), `value` is infinite, `predicate`, `name`, `line`, `column` and `margin` are None and
    `step` is the last sample.
    """

    value: float
    predicate: str | None
    name: str | None  # innermost named sub-formula that holds the predicate
    source: str
    line: int | None
    column: int | None
    step: int
    margin: float | None
    negated: bool
    definitions: Mapping[str, float]  # each named sub-formula's value on the whole trajectory

    @property
    def satisfied(self) -> bool:
        """Robustness above zero. At exactly zero neither the formula nor its negation is robustly true."""
        return self.value > 0

    def __str__(self) -> str:
        verdict = "satisfied" if self.value > 0 else "violated" if self.value < 0 else "undecided"
        if self.predicate is None:
            return f"{verdict}, robustness {self.value:+g}: decided by the end of the trajectory, step {self.step}"
        part = f" in {self.name}" if self.name else ""
        atom = f"!({self.predicate})" if self.negated else self.predicate
        return (
            f"{verdict}, robustness {self.value:+.6g}: decided at step {self.step} by {atom}{part}, "
            f"margin {self.margin:+.6g} ({self.source}:{self.line}:{self.column})"
        )


def explain(meaning: Meaning, source: str, signals: Signals) -> Explanation:
    """Explain one trajectory: `signals` hold (1, T) arrays."""
    graph = meaning.graph
    end = next(iter(signals.values())).shape[1]
    titles: dict[int, str] = {}
    for title, (node, _) in meaning.definitions.items():
        titles.setdefault(node, title)
    nodes = _formulas(meaning, [meaning.root, *titles])

    @cache
    def suffixes(stop: int) -> Values:
        """The value of every formula on every slice [t, stop)."""
        cut = {key: array[:, :stop] for key, array in signals.items()}
        return {n: v[0] for n, v in plan(graph, dict.fromkeys(nodes, (0, stop)), stop).run(cut).items()}

    node, t, stop, negated, name = meaning.root, 0, end, False, None
    definitions = {title: float(suffixes(end)[n][0]) for title, (n, _) in meaning.definitions.items()}
    value = float(suffixes(end)[node][0])
    while True:
        name = titles.get(node, name)
        if node in meaning.predicates:
            found = meaning.predicates[node]
            margin = float(suffixes(stop)[node][t])
            line, column = found.span.line, found.span.column
            return Explanation(value, found.text, name, source, line, column, t, margin, negated, definitions)
        negated ^= graph.ops[node].name == "negative"
        step = _step(graph.ops[node], suffixes(stop)[node][t], t, stop, suffixes)
        if step is None:
            return Explanation(value, None, None, source, None, None, stop - 1, None, negated, definitions)
        node, t, stop = step


def _formulas(meaning: Meaning, roots: list[int]) -> list[int]:
    """The formulas among the nodes that the roots depend on: down to predicates, not into their
    arithmetic."""
    found: set[int] = set()
    while roots:
        node = roots.pop()
        if node not in found:
            found.add(node)
            roots.extend(() if node in meaning.predicates else meaning.graph.ops[node].args)
    return sorted(found)


def _step(op: Op, value: float, t: int, stop: int, suffixes: Callable[[int], Values]) -> tuple[int, int, int] | None:
    """The argument, its step and the end of its slice that give an operation its value at t on [t, stop).

    None when there is none: the end of the trajectory decides.
    """
    values = suffixes(stop)
    match op.name, op.data:
        case "negative", _:
            return op.args[0], t, stop
        case (("minimum" | "maximum"), _):
            return next(a for a in op.args if values[a][t] == value), t, stop
        case "next", (int(k), _):
            return (op.args[0], t + k, stop) if t + k < stop else None
        case (("always" | "eventually"), (window,)):
            low, high = window if isinstance(window, tuple) else (0, stop)
            seen = values[op.args[0]][t + low : min(t + high + 1, stop)]
            return (op.args[0], t + low + _first(seen, value), stop) if len(seen) else None
        case (("until" | "then"), (window, bool(truncated))):
            low, high = window if isinstance(window, tuple) else (0, stop)
            p, q = op.args
            fold, empty = (np.minimum, np.inf) if op.name == "until" else (np.maximum, -np.inf)
            if truncated:
                lefts = ((suffixes(e)[p][t:] if e > t else values[p][:0]) for e in range(t, stop))
                held = np.array([fold.reduce(left, initial=empty) for left in lefts])
            else:
                held = np.concatenate(([empty], fold.accumulate(values[p][t : stop - 1])))
            ends = np.arange(t, stop)
            reached = np.minimum(values[q][t:stop], held) == value
            matches = ends[reached & (ends >= t + low) & (ends <= t + high)]
            if not len(matches):
                return None
            e = int(matches[0])
            if values[q][e] == value:
                return q, e, stop
            if e == t:
                return None
            before = (suffixes(e) if truncated else values)[p][t:e]
            return p, t + _first(before, value), e if truncated else stop
    raise TypeError(f"{op.name} is no formula")


def _first(seen: Array, value: float) -> int:
    return int(np.flatnonzero(seen == value)[0])
