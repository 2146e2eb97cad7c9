"""Which predicate, at which step, decides a robustness value."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from tltlrl.logic.graph import PAST, Array
from tltlrl.logic.meaning import Meaning, Truth
from tltlrl.logic.semantics import Signals, Values, plan

Suffixes = Callable[[int, Truth], Values]


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why one trajectory has its robustness.

    min and max each select one operand. So the value of a formula is the margin of one predicate at one step, negated
    once per negation on the way: `value == -margin if negated else margin`, exactly.

    The edge of the trajectory may decide instead: its end (X at the last sample, T without a second sample) or its
    start (previous at the first sample). Then `value` is infinite, `predicate`, `name`, `line`, `column` and `margin`
    are None, `step` is the last sample or the first, and `edge` says which. The left operand of U or T is read on the
    samples before the right one only; where it decides, the end is that of this part.
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
    edge: str = "end"

    @property
    def satisfied(self) -> bool:
        """Robustness above zero. At exactly zero neither the formula nor its negation is robustly true."""
        return self.value > 0

    @property
    def verdict(self) -> str:
        """`satisfied`, `violated`, or `undecided` at exactly zero."""
        return "satisfied" if self.value > 0 else "violated" if self.value < 0 else "undecided"

    @property
    def decided_by(self) -> str:
        """What decides, in words: `at step 3 by !(x < 1) in low, margin -0.2`, with the margin of the formula shown."""
        if self.predicate is None:
            return f"by the {self.edge} of the trajectory, step {self.step}"
        part = f" in {self.name}" if self.name else ""
        atom = f"!({self.predicate})" if self.negated else self.predicate
        return f"at step {self.step} by {atom}{part}, margin {self.value:+.6g}"

    @property
    def place(self) -> str:
        """The place of the predicate, `file:line:column`; only the file when the edge of the trajectory decides."""
        return self.source if self.line is None else f"{self.source}:{self.line}:{self.column}"

    def __str__(self) -> str:
        return f"{self.verdict}, robustness {self.value:+.6g}: decided {self.decided_by} ({self.place})"


def explain(meaning: Meaning, source: str, signals: Signals) -> Explanation:
    """Explains the robustness of one trajectory, whose signals are arrays (1, T)."""
    end = next(iter(signals.values())).shape[1]

    def suffixes(stop: int, *formulas: Truth) -> Values:
        """The values of these formulas and of all below them, on every slice [t, stop)."""
        cut = {key: array[:, :stop] for key, array in signals.items()}
        wanted = dict.fromkeys(nodes(formulas), (0, stop))
        return {node: array[0] for node, array in plan(meaning.graph, wanted, stop).run(cut).items()}

    named = {title: truth for title, (truth, _) in meaning.definitions.items()}
    values = suffixes(end, meaning.formula, *named.values())
    # Adding 0.0 makes +0.0 of the -0.0 that a negation leaves.
    definitions = {title: float(values[truth.node][0]) + 0.0 for title, truth in named.items()}
    value = float(values[meaning.root][0]) + 0.0
    end_of = descend(meaning.formula, values, end, suffixes)
    predicate, t = end_of.formula.predicate, end_of.step
    if predicate is None:
        return Explanation(value, None, None, source, None, None, t, None, end_of.negated, definitions, end_of.edge)
    span, margin = predicate.span, end_of.margin + 0.0
    return Explanation(
        value, predicate.text, end_of.name, source, span.line, span.column, t, margin, end_of.negated, definitions
    )


@dataclass(frozen=True, slots=True)
class Deciding:
    """What gives a formula its value: the end of the way down through its operators.

    Attributes:
      formula: the last formula on the way: a predicate, or an operator that the edge of the trajectory decides.
      step: the step at which it decides.
      margin: its value there.
      negated: whether there are an odd number of negations on the way.
      name: the innermost named sub-formula on the way.
      edge: the edge of the trajectory that decides, if one does.
    """

    formula: Truth
    step: int
    margin: float
    negated: bool
    name: str | None
    edge: str = "end"


def descend(formula: Truth, values: Values, stop: int, suffixes: Suffixes | None) -> Deciding:
    """Finds what gives a formula its value at the first sample.

    Args:
      formula: where to begin.
      values: values of the formula and all below it at every step of one trajectory, node => (T,).
      stop: how many samples the trajectory has.
      suffixes: computes the same on slices that end earlier. Without it the way ends at an operator that needs them:
        a U or T whose left operand holds temporal operators.
    """
    t, negated, name = 0, False, None
    while True:
        name = formula.name or name
        margin = float(values[formula.node][t])
        if formula.predicate is not None or (suffixes is None and _is_truncated(formula)):
            return Deciding(formula, t, margin, negated, name)
        negated ^= formula.operation == "negative"
        step = _step(formula, t, stop, values, suffixes)
        if step is None:
            edge, at = ("start", 0) if formula.operation in PAST else ("end", stop - 1)
            return Deciding(formula, at, margin, negated, name, edge)
        formula, t, cut = step
        if cut < stop:
            assert suffixes is not None
            values, stop = suffixes(cut, formula), cut


def _is_truncated(formula: Truth) -> bool:
    return formula.operation in {"until", "then"} and formula.data[1] is True


def nodes(formulas: Iterable[Truth]) -> list[int]:
    """The nodes of these formulas and of all formulas below them; predicates' arithmetic is left out."""
    found: dict[Truth, int] = {}
    stack = list(formulas)
    while stack:
        formula = stack.pop()
        if formula not in found:
            found[formula] = formula.node
            stack.extend(formula.parts)
    return sorted(set(found.values()))


def _step(
    formula: Truth, t: int, stop: int, values: Values, suffixes: Suffixes | None
) -> tuple[Truth, int, int] | None:
    """The part that gives a formula its value at t on [t, stop), with its step and the end of its slice.

    None if the edge of the trajectory decides. `values` are for slices that end at `stop`; `suffixes` computes them for
    slices that end earlier.
    """
    value = values[formula.node][t]
    match formula.operation, formula.data:
        case "negative", _:
            return formula.parts[0], t, stop
        case (("minimum" | "maximum"), _):
            return next(part for part in formula.parts if values[part.node][t] == value), t, stop
        case "next", (int(k), _):
            return (formula.parts[0], t + k, stop) if t + k < stop else None
        case "ends", _:
            return None
        case "previous", (int(k), _):
            return (formula.parts[0], t - k, stop) if t >= k else None
        case (("once" | "historically"), (window,)):
            low, high = window if isinstance(window, tuple) else (0, t)
            first = max(0, t - high)
            seen = values[formula.parts[0].node][first : max(0, t - low + 1)]
            return (formula.parts[0], first + _first(seen, value), stop) if len(seen) else None
        case "since", _:
            p, q = formula.parts
            held = np.concatenate((np.minimum.accumulate(values[p.node][t:0:-1])[::-1], [np.inf]))  # at t' + 1 .. t
            began = int(np.flatnonzero(np.minimum(values[q.node][: t + 1], held) == value)[-1])
            if values[q.node][began] == value:
                return q, began, stop
            return p, began + 1 + _first(values[p.node][began + 1 : t + 1], value), stop
        case (("always" | "eventually"), (window,)):
            low, high = window if isinstance(window, tuple) else (0, stop)
            seen = values[formula.parts[0].node][t + low : min(t + high + 1, stop)]
            return (formula.parts[0], t + low + _first(seen, value), stop) if len(seen) else None
        case (("until" | "then"), (window, bool(truncated))):
            low, high = window if isinstance(window, tuple) else (0, stop)
            p, q = formula.parts
            fold, empty = (np.minimum, np.inf) if formula.operation == "until" else (np.maximum, -np.inf)
            if truncated:
                assert suffixes is not None
                lefts = (suffixes(e, p)[p.node][t:] for e in range(t + 1, stop))
                held = np.array([empty, *(fold.reduce(left) for left in lefts)])
            else:
                held = np.concatenate(([empty], fold.accumulate(values[p.node][t : stop - 1])))
            ends = np.arange(t, stop)
            reached = np.minimum(values[q.node][t:stop], held) == value
            matches = ends[reached & (ends >= t + low) & (ends <= t + high)]
            if not len(matches):
                return None
            e = int(matches[0])
            if values[q.node][e] == value:
                return q, e, stop
            if e == t:
                return None
            before = (suffixes(e, p) if truncated and suffixes else values)[p.node][t:e]
            return p, t + _first(before, value), e if truncated else stop
    raise TypeError(f"{formula.operation} is no formula")


def _first(seen: Array, value: float) -> int:
    return int((seen == value).argmax())
