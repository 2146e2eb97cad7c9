"""A cheaper graph for the value at the first sample, with the same value to the last bit.

At the first sample a G or F is one reduction over time. Reductions commute with monotone operations: G (p & q) is
G p & G q, and the minimum of distance - radius is the smallest distance - radius, which is the root of the smallest
squared distance - radius. `G (g => X G !g)` (visit g once) is the minimum over pairs of samples of the larger of two
values of !g. That is the second smallest value of !g over time. Rounding is monotone too, so no bit changes.
"""

from tltlrl.logic.graph import Graph

_DUAL = {"always": "eventually", "eventually": "always"}
_OWN = {"always": "minimum", "eventually": "maximum"}
_DEEPEST = 50  # operations that a reduction is moved through


def at_start(graph: Graph, root: int) -> int:
    """The number of a node whose value at the first sample is that of `root`."""
    nodes = graph.below([root])
    reached = {root}
    for node in reversed(nodes):
        op = graph.ops[node]
        if node in reached and op.name in {"minimum", "maximum", "negative"}:
            reached.update(op.args)
    equal: dict[int, int] = {}
    moved: dict[tuple[str, int], int] = {}
    for node in nodes:
        op = graph.ops[node]
        if node not in reached or graph.local[node]:
            equal[node] = node
        elif op.name in {"minimum", "maximum", "negative"}:
            equal[node] = graph.add(op.name, *(equal[arg] for arg in op.args))
        elif op.name in _DUAL and op.data == (None,) and graph.local[op.args[0]]:
            equal[node] = _reduction(graph, op.name, op.args[0], _DEEPEST, moved)
        elif (once := _once(graph, node)) is not None:
            equal[node] = graph.add("second", once)
        else:
            equal[node] = node
    return equal[root]


def _once(graph: Graph, node: int) -> int | None:
    """The p of `G (p | X G p)`, if the node is one and p a state formula."""
    op = graph.ops[node]
    if op.name != "always" or op.data != (None,) or graph.ops[op.args[0]].name != "maximum":
        return None
    pair = graph.ops[op.args[0]].args
    for p, later in (pair, pair[::-1]) if len(pair) == 2 else ():
        rest = graph.ops[later]
        if graph.local[p] and rest.name == "next" and rest.data == (1, False):
            inner = graph.ops[rest.args[0]]
            if inner.name == "always" and inner.data == (None,) and inner.args == (p,):
                return p
    return None


def _reduction(graph: Graph, name: str, node: int, depth: int, moved: dict[tuple[str, int], int]) -> int:
    """G or F of a node, moved inwards through what is monotone; `moved` remembers those that are."""
    op = graph.ops[node]

    def of(arg: int, name: str = name) -> int:
        return _reduction(graph, name, arg, depth - 1, moved)

    if (name, node) not in moved:
        constant = [graph.ops[arg].name == "constant" for arg in op.args]
        if depth == 0:
            reduction = graph.add(name, node, data=(None,))
        elif op.name == "negative":
            reduction = graph.add("negative", of(op.args[0], _DUAL[name]))
        elif op.name == _OWN[name]:
            reduction = graph.add(op.name, *map(of, op.args))
        elif op.name == "subtract" and constant[1]:
            reduction = graph.add("subtract", of(op.args[0]), op.args[1])
        elif op.name == "subtract" and constant[0]:
            reduction = graph.add("subtract", op.args[0], of(op.args[1], _DUAL[name]))
        elif op.name == "norm":
            reduction = graph.add("sqrt", graph.add(name, graph.add("squares", *op.args), data=(None,)))
        else:
            reduction = graph.add(name, node, data=(None,))
        moved[name, node] = reduction
    return moved[name, node]
