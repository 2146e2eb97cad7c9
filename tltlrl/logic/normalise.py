"""Predicates brought to one scale: each divided by its spread over trajectories that were seen.

The case study asks for an "automatic or adaptive normalization of predicate robustnesses": min and max compare margins
of different kinds, and a predicate whose unit makes its margins small is never heard. Dividing by a positive number
keeps every sign, so a trajectory satisfies the normalised spec where it satisfies the spec; what changes is which
predicate decides by how much.

The spread of a predicate is the standard deviation of its margin over all samples. The members of a family, and every
other predicate that is written at one place, have one spread: the root mean square of theirs.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tltlrl.logic.graph import Array, Graph
from tltlrl.logic.meaning import Meaning, Truth
from tltlrl.logic.shortcut import at_start


def predicates(formula: Truth) -> dict[int, object]:
    """The nodes of the predicates below a formula, each with the place where it is first written."""
    places: dict[int, object] = {}
    seen, stack = {id(formula)}, [formula]
    while stack:
        truth = stack.pop()
        if truth.predicate is not None:
            places.setdefault(truth.node, truth.predicate.span)
        for part in truth.parts:
            if id(part) not in seen:
                seen.add(id(part))
                stack.append(part)
    return places


def spreads(places: Mapping[int, object], margins: Mapping[int, Array]) -> dict[int, float]:
    """The spread of each predicate; 1 where its margin never changes.

    Args:
      places: predicate's node => where it is written.
      margins: its node => its values, of any shape; those that are not finite count for nothing.
    """
    variances = defaultdict(list)
    for node, place in places.items():
        seen = margins[node][np.isfinite(margins[node])]
        variances[place].append(float(np.var(seen)) if len(seen) else 0.0)
    spread = {place: float(np.sqrt(np.mean(values))) for place, values in variances.items()}
    return {node: spread[place] or 1.0 for node, place in places.items()}


def divided(meaning: Meaning, scales: Mapping[int, float]) -> Meaning:
    """The same meaning with each of these predicates divided by its scale; named sub-formulas keep theirs.

    Only its formula is meant to be evaluated.
    """
    graph = Graph()
    number: dict[int, int] = {}
    for node, op in enumerate(meaning.graph.ops):
        copied = graph.add(op.name, *(number[arg] for arg in op.args), data=op.data)
        if node in scales:
            copied = graph.add("divide", copied, graph.add("constant", data=(scales[node],)))
        number[node] = copied
    graph.split = {number[node]: (number[right], upper) for node, (right, upper) in meaning.graph.split.items()}
    graph.split_past = {
        number[node]: (number[left], number[right], upper)
        for node, (left, right, upper) in meaning.graph.split_past.items()
    }
    copies: dict[int, Truth] = {}

    def renumbered(truth: Truth) -> Truth:
        if id(truth) not in copies:
            parts = tuple(map(renumbered, truth.parts))
            copies[id(truth)] = replace(truth, node=number[truth.node], parts=parts)
        return copies[id(truth)]

    formula = renumbered(meaning.formula)
    return replace(
        meaning,
        graph=graph,
        formula=formula,
        root=formula.node,
        start=at_start(graph, formula.node),
        definitions={},
        places={number[node]: place for node, place in meaning.places.items()},
    )
