"""The values of a formula's parts on many trajectories: of its clauses and its named sub-formulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic import syntax
from tltlrl.logic.explain import descend, nodes
from tltlrl.logic.graph import SELECTING, Array
from tltlrl.logic.meaning import Meaning, Truth


@dataclass(frozen=True)
class Parts:
    """The values of a formula's parts on N trajectories, and which of them decide.

    Attributes:
      clauses: text of each top-level clause => its robustness on the whole trajectory, (N,).
      highest, lowest: name of each sub-formula => its largest and its smallest value over the samples, (N,). If the
        largest is above 0, it holds at some sample; if the smallest is, at all.
      clause: index of the first clause whose value is the robustness, (N,).
      name: index of the innermost named sub-formula that holds the deciding predicate, -1 for none, (N,).
    """

    clauses: Mapping[str, Array]
    highest: Mapping[str, Array]
    lowest: Mapping[str, Array]
    clause: NDArray[np.intp]
    name: NDArray[np.intp]

    @property
    def robustness(self) -> Array:
        """The robustness of each whole trajectory, (N,)."""
        return np.min(list(self.clauses.values()), axis=0)

    def of_first(self, count: int) -> Parts:
        """The values on the first `count` trajectories."""
        clauses, highest, lowest = (
            {part: values[:count] for part, values in found.items()}
            for found in (self.clauses, self.highest, self.lowest)
        )
        return Parts(clauses, highest, lowest, self.clause[:count], self.name[:count])


def clauses_of(meaning: Meaning) -> dict[str, Truth]:
    """Text => clause, for the operands of the conjunction at the top of the formula, or the formula itself."""
    formula, written = meaning.formula, meaning.document.formula
    if not isinstance(written, syntax.And):
        return {str(written): formula}
    return {str(operand): part for operand, part in zip(written.operands, formula.parts, strict=True)}


def conjuncts_of(meaning: Meaning) -> tuple[int, ...]:
    """The nodes of the parts whose minimum the formula is: its clauses, and what is in them under `all`, & and G.

    G (a & b) is G a & G b (for robustness, too), so the members of a family under G are conjuncts of their own. Nodes
    that the formula does not have are added to the graph.
    """

    def within(truth: Truth) -> list[int]:
        if truth.operation == "minimum":
            return [node for part in truth.parts for node in within(part)]
        if truth.operation == "always" and len(truth.parts) == 1:
            return [meaning.graph.add("always", node, data=truth.data) for node in within(truth.parts[0])]
        return [truth.node]

    return tuple(dict.fromkeys(within(meaning.formula)))


@dataclass(frozen=True)
class Reading:
    """What `parts` reads of a formula.

    Attributes:
      clauses: text => clause.
      names: for each clause the names, one of which is the innermost one that holds what decides; None for no name.
      over_time: the nodes that are read at every sample.
      at_start: the nodes that are read at the first sample alone: those at the top of the formula, down to the
        uppermost temporal operators.
    """

    clauses: Mapping[str, Truth]
    names: tuple[frozenset[str | None], ...]
    over_time: tuple[int, ...]
    at_start: tuple[int, ...]


def reading(meaning: Meaning) -> Reading:
    """What `parts` reads of a spec's formula."""
    clauses = clauses_of(meaning)
    at_start, below = [], [truth for truth, _ in meaning.definitions.values()]
    stack = [meaning.formula]
    while stack:
        truth = stack.pop()
        at_start.append(truth.node)
        (stack if truth.operation in SELECTING else below).extend(truth.parts)
    over_time = tuple(nodes(below))
    top = tuple(sorted({*at_start} - {*over_time}))
    return Reading(clauses, tuple(_names(clause) for clause in clauses.values()), over_time, top)


def _names(formula: Truth) -> frozenset[str | None]:
    """The names, one of which is the innermost one that holds what decides the formula; None for no name."""
    found: set[str | None] = set()
    stack: list[tuple[Truth, str | None]] = [(formula, None)]
    seen = set()
    while stack:
        truth, name = stack.pop()
        name = truth.name or name
        if (truth, name) in seen:
            continue
        seen.add((truth, name))
        unbounded = truth.operation in {"always", "eventually"} and truth.data == (None,)
        if not truth.parts or not (unbounded or truth.operation in SELECTING):
            found.add(name)  # a predicate, or an operator that the edge of the trajectory may decide
        stack.extend((part, name) for part in truth.parts)
    return frozenset(found)


def parts(meaning: Meaning, read: Reading, values: Mapping[int, Array], lengths: NDArray[np.intp]) -> Parts:
    """Computes the values of a formula's parts on N trajectories.

    Args:
      meaning: the spec's meaning.
      read: its `reading`.
      values: values of the nodes that it names, node => (N, T); those read at the first sample alone may be shorter.
      lengths: samples of each trajectory that count, (N,).
    """
    clauses = {text: values[clause.node][:, 0] for text, clause in read.clauses.items()}
    first = np.argmin(np.stack(list(clauses.values())), axis=0)
    counts = np.arange(int(lengths.max(initial=1))) < lengths[:, None]
    named = {name: values[truth.node][:, : counts.shape[1]] for name, (truth, _) in meaning.definitions.items()}
    number: dict[str | None, int] = {None: -1} | {name: i for i, name in enumerate(named)}
    deciding = np.empty(len(lengths), dtype=np.intp)
    for i, (clause, names) in enumerate(zip(read.clauses.values(), read.names, strict=True)):
        rows = np.flatnonzero(first == i)
        if len(names) == 1:
            deciding[rows] = number[next(iter(names))]
            continue
        for row in rows.tolist():  # the values say which
            length = int(lengths[row])
            deciding[row] = number[descend(clause, _Trajectory(values, row, length), length, None).name]
    return Parts(
        clauses,
        {name: np.where(counts, array, -np.inf).max(axis=1) for name, array in named.items()},
        {name: np.where(counts, array, np.inf).min(axis=1) for name, array in named.items()},
        first,
        deciding,
    )


class _Trajectory(dict[int, Array]):
    """The values of one trajectory, cut where they are looked up: few nodes lie on the way to what decides."""

    def __init__(self, values: Mapping[int, Array], row: int, length: int) -> None:
        self._values, self._row, self._length = values, row, length

    def __missing__(self, node: int) -> Array:
        own = self[node] = self._values[node][self._row, : self._length]
        return own


def wanted(meaning: Meaning) -> dict[str, tuple[str, ...]]:
    """Clause => the named sub-formulas in it that it asks to hold: under no negation, or an even number."""
    found = {}
    for text, clause in clauses_of(meaning).items():
        names: dict[str, None] = {}
        stack, seen = [(clause, False)], set()
        while stack:
            truth, negated = stack.pop()
            if (truth, negated) in seen:
                continue
            seen.add((truth, negated))
            if truth.name is not None and not negated:
                names[truth.name] = None
            negated ^= truth.operation == "negative"
            stack.extend((part, negated) for part in truth.parts)
        found[text] = tuple(name for name in meaning.definitions if name in names)
    return found
