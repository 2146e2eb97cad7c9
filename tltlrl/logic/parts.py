"""The values of a formula's parts on many trajectories: of its clauses and its named sub-formulas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic import syntax
from tltlrl.logic.explain import descend
from tltlrl.logic.graph import Array
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


def parts(meaning: Meaning, values: Mapping[int, Array], lengths: NDArray[np.intp]) -> Parts:
    """Computes the values of a formula's parts on N trajectories.

    Args:
      meaning: the spec's meaning.
      values: values of the formula, all below it and the named sub-formulas, node => (N, T).
      lengths: samples of each trajectory that count, (N,).
    """
    clauses = {text: values[clause.node][:, 0] for text, clause in clauses_of(meaning).items()}
    counts = np.arange(next(iter(values.values())).shape[1]) < lengths[:, None]
    named = {name: values[truth.node] for name, (truth, _) in meaning.definitions.items()}
    number = {name: i for i, name in enumerate(named)}
    deciding = np.full(len(lengths), -1)
    for row, length in enumerate(lengths):
        name = descend(meaning.formula, _Trajectory(values, row, int(length)), int(length), None).name
        deciding[row] = -1 if name is None else number[name]
    return Parts(
        clauses,
        {name: np.where(counts, array, -np.inf).max(axis=1) for name, array in named.items()},
        {name: np.where(counts, array, np.inf).min(axis=1) for name, array in named.items()},
        np.argmin(np.stack(list(clauses.values())), axis=0),
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
