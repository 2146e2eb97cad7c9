"""Brings predicates to one scale: divides each by its spread over given trajectories.

The case study asks for an "automatic or adaptive normalization of predicate robustnesses": min and max compare margins
of different kinds, so the choice of units can settle which predicate decides. Dividing by a positive number keeps every
sign, so a trajectory satisfies the normalised spec if and only if it satisfies the spec. What changes is which
predicate decides, and by how much.

The spread of a predicate is the standard deviation of its margin over all samples. Predicates
written at the same place, such as the members of a family, share one spread: the root mean square of their own. A
predicate that does not change there, but for rounding, is divided by its largest margin, so that its unit does not
matter either.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from tltlrl.logic.graph import Array, Graph
from tltlrl.logic.meaning import Meaning, Truth
from tltlrl.logic.shortcut import at_start

ROUNDING = 1e-9  # of the largest margin: what changes by less does not change


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
    """The spread of each predicate; its largest margin where it never changes, or 1 where that is 0, but for rounding.

    Args:
      places: predicate's node => where it is written.
      margins: predicate's node => its values, of any shape; values that are not finite are ignored.
    """
    seen = defaultdict(list)
    for node, place in places.items():
        seen[place].append(margins[node][np.isfinite(margins[node])])
    scales: dict[object, float] = {}
    for place, values in seen.items():
        spread = float(np.sqrt(np.mean([np.var(margin) if len(margin) else 0.0 for margin in values])))
        largest = float(max(np.max(np.abs(margin), initial=0.0) for margin in values))
        still = largest if largest > ROUNDING**2 else 1.0  # below, it is rounding error itself
        scales[place] = spread if spread > max(ROUNDING * largest, ROUNDING**2) else still
    return {node: scales[place] for node, place in places.items()}


def divided(meaning: Meaning, scales: Mapping[int, float]) -> Meaning:
    """The same meaning with each of these predicates in its formula divided by its scale.

    Named sub-formulas are not changed, so only the formula should be evaluated.
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
