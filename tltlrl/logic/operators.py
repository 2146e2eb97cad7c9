"""The operators that are made of others: each as operations of the graph on formulas (see tltlrl.logic.graph.Op)."""

from tltlrl.logic.graph import BEGUN, FOREVER, Graph
from tltlrl.logic.meaning import Truth

Window = tuple[int, int] | None  # in steps; None where it is the whole slice


def operation(graph: Graph, name: str, *parts: Truth, data: tuple[object, ...] = ()) -> Truth:
    """One operation of the graph, on formulas."""
    return Truth(graph.add(name, *(part.node for part in parts), data=data), name, parts, data)


def negation(graph: Graph, p: Truth) -> Truth:
    """!p"""
    return operation(graph, "negative", p)


def both(graph: Graph, *parts: Truth) -> Truth:
    """p & q & ..."""
    return operation(graph, "minimum", *parts)


def either(graph: Graph, *parts: Truth) -> Truth:
    """p | q | ..."""
    return operation(graph, "maximum", *parts)


def implication(graph: Graph, p: Truth, q: Truth) -> Truth:
    """p => q = !p | q"""
    return either(graph, negation(graph, p), q)


# The future


def reduced(graph: Graph, name: str, p: Truth, window: Window) -> Truth:
    """G or F; F[a,inf] p = X[!]^a F p, and G[a,inf] p = X^a G p."""
    if window is None or window[1] < FOREVER:
        return operation(graph, name, p, data=(window,))
    whole = operation(graph, name, p, data=(None,))
    return operation(graph, "next", whole, data=(window[0], name == "eventually"))


def until(graph: Graph, p: Truth, q: Truth, window: Window) -> Truth:
    """U, with a window split off where p holds no temporal operator.

    p U[a,b] q = F[a,b] q & G[0,a-1] p & X[!]^a (p U q), in value too: a witness of the last part beyond
    b can be replaced by the one of the first. The left operand must not depend on the witness for this. Without
    an end the first part is not needed.
    """
    truncated = not graph.local[p.node]
    if window is None or truncated:
        return operation(graph, "until", p, q, data=(window, truncated))
    whole = operation(graph, "until", p, q, data=(None, False))
    parts = [] if window[1] == FOREVER else [operation(graph, "eventually", q, data=(window,))]
    if window[0] > 0:
        parts.append(operation(graph, "always", p, data=((0, window[0] - 1),)))
        whole = operation(graph, "next", whole, data=(window[0], True))
    bounded = both(graph, *parts, whole)
    if window[1] < FOREVER:
        graph.split[bounded.node] = q.node, window[1]
    return bounded


def until_or_cut(graph: Graph, p: Truth, q: Truth, window: Window) -> Truth:
    """U[a,b?]: it holds, too, where p does up to the end, and the end cuts the window."""
    held = operation(graph, "always", p, data=(None,))
    return either(graph, until(graph, p, q, window), both(graph, cut(graph, window), held))


def weak_until(graph: Graph, p: Truth, q: Truth, window: Window) -> Truth:
    """p W[a,b] q = p U[a,b] q | G[0,b] p"""
    held = None if window is None or window[1] == FOREVER else (0, window[1])
    return either(graph, until(graph, p, q, window), operation(graph, "always", p, data=(held,)))


def then(graph: Graph, p: Truth, q: Truth, window: Window) -> Truth:
    """T"""
    return operation(graph, "then", p, q, data=(window, not graph.local[p.node]))


def cut(graph: Graph, window: Window) -> Truth:
    """Whether the end of the trajectory cuts the window: true or false."""
    assert window is not None
    data = (window[1],)
    return Truth(graph.add("ends", data=data), "ends", (), data)


# The past. Trajectories of different length are aligned at their ends: what stands before a trajectory is made neutral
# by BEGUN, which says where it begins.


def _present(graph: Graph, p: Truth, holds: bool) -> int:
    """p from the first sample on, and before it true or false."""
    begun = graph.add("signal", data=BEGUN)
    if holds:
        return graph.add("maximum", p.node, graph.add("negative", begun))
    return graph.add("minimum", p.node, begun)


def previous(graph: Graph, p: Truth, steps: int, strong: bool) -> Truth:
    """p so many samples ago; where there was none, the strong one is false and the other true."""
    if steps == 0:
        return p
    data = (steps, strong)
    return Truth(graph.add("previous", _present(graph, p, not strong), data=data), "previous", (p,), data)


def looking_back(graph: Graph, name: str, p: Truth, window: Window) -> Truth:
    """once or historically; once[a,inf] p = previous[!]^a once p, and historically[a,inf] alike."""
    is_once = name == "once"
    within = None if window is None or window[1] == FOREVER else window
    whole = Truth(graph.add(name, _present(graph, p, not is_once), data=(within,)), name, (p,), (within,))
    return whole if window is None or within is not None else previous(graph, whole, window[0], is_once)


def since(graph: Graph, p: Truth, q: Truth, window: Window) -> Truth:
    """p since q, with a window split off as for U: what is read does not depend on the witness."""
    whole = Truth(graph.add("since", p.node, _present(graph, q, False)), "since", (p, q))
    if window is None:
        return whole
    low, high = window
    parts = [] if high == FOREVER else [looking_back(graph, "once", q, window)]
    if low > 0:
        parts.append(looking_back(graph, "historically", p, (0, low - 1)))
    bounded = both(graph, *parts, previous(graph, whole, low, True))
    if high < FOREVER:
        graph.split_past[bounded.node] = p.node, q.node, high
    return bounded


def change(graph: Graph, p: Truth, upwards: bool) -> Truth:
    """rise(p) = p & previous !p, or fall(p) = !p & previous p"""
    now, before = (p, negation(graph, p)) if upwards else (negation(graph, p), p)
    return both(graph, now, previous(graph, before, 1, False))
