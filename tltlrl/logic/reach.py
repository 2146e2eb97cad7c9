"""Finds what the length of a trajectory decides by itself: windows that lie beyond its end."""

import numpy as np

from tltlrl.logic.meaning import Meaning, Truth
from tltlrl.logic.semantics import Signals, plan


def beyond(meaning: Meaning, signals: Signals) -> tuple[Truth, float] | None:
    """The innermost part of the formula that all or no trajectories of this length satisfy, and its value +-inf.

    Every operation selects one of its arguments or the infinite value of an empty minimum or maximum, so whether a
    value is infinite does not depend on the trajectory. A part that is read at the first sample alone counts if it is
    infinite there; one under a temporal operator if it is at every sample. None if there is no such
    part, or if the formula holds truths (signal p: bool, holds), whose values are always infinite.

    Args:
      meaning: the spec's meaning.
      signals: signals of any trajectory of that length, arrays (1, T).
    """
    if any(op.name == "holds" for op in meaning.graph.ops):
        return None
    steps = next(iter(signals.values())).shape[1]
    parts = _read_on_suffixes(meaning.formula)
    nodes = sorted({part.node for part in parts})
    try:
        values = plan(meaning.graph, dict.fromkeys(nodes, (0, steps)), steps).run(signals)
    except FloatingPointError:  # an expression has no finite value on this one trajectory; on others it may have
        return None

    def look(part: Truth, at_start: bool) -> tuple[Truth, float] | None:
        if part.predicate is not None:
            return None
        below_at_start = at_start and part.operation in {"negative", "minimum", "maximum"}
        for below in part.parts:
            if below in parts and (found := look(below, below_at_start)):
                return found
        seen = values[part.node][0, :1] if at_start else values[part.node][0]
        infinite = np.all(seen == np.inf) or np.all(seen == -np.inf)
        return (part, float(seen[0])) if infinite and part.span is not None else None

    return look(meaning.formula, True)


def _read_on_suffixes(formula: Truth) -> set[Truth]:
    """The formula and all below it, but for what is read on slices that end earlier."""
    found: set[Truth] = set()
    stack = [formula]
    while stack:
        part = stack.pop()
        if part not in found:
            found.add(part)
            truncated = part.operation in {"until", "then"} and part.data[1]
            stack += part.parts[1:] if truncated else part.parts
    return found
