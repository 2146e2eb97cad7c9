"""Robustness of a graph on batches of trajectories of one length.

Arrays are (trajectories, steps). Each node is
computed only at the steps that the wanted values depend on: a root F or G is one reduction, `F G p` is p at
the last sample, a bounded formula looks at its horizon. What is wanted where depends on the length alone,
so a plan is made once per length and reused.

Time is linear in trajectories, steps and nodes; windows of any width cost the same. Only a left operand of
U or T that holds temporal operators is evaluated once for each possible end of its slice, which costs
steps^2 (and once more that factor for such an operand inside such an operand).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from tltlrl.spec import scans
from tltlrl.spec.graph import PARTIAL, Array, Graph, Op, apply

Steps = tuple[int, int]  # half-open
Values = dict[int, Array]
Signals = Mapping[tuple[str, int | None], Array]
Compute = Callable[[Values, Signals], Array]

_FOLDS = {"always": np.minimum, "eventually": np.maximum, "until": np.minimum, "then": np.maximum}
_EMPTY = {"always": np.inf, "eventually": -np.inf, "until": np.inf, "then": -np.inf, "next": np.inf}
_TEMPORAL = {*_EMPTY}


@dataclass(frozen=True, slots=True)
class Plan:
    """How to compute some nodes on trajectories of one length: instructions in order, and what to forget
    when."""

    graph: Graph
    end: int
    steps: Mapping[int, Steps]  # node -> the steps it is computed at
    instructions: tuple[tuple[int, Compute, tuple[int, ...]], ...]

    def run(self, signals: Signals, given: Values | None = None) -> Values:
        """The values of the plan's roots. Raises FloatingPointError where an expression has no finite
        value."""
        values: Values = dict(given or {})
        with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
            for node, compute, dead in self.instructions:
                values[node] = compute(values, signals)
                for forgotten in dead:
                    del values[forgotten]
        return values

    def failure(self, signals: Signals) -> tuple[int, int, int]:
        """Node, step and trajectory of the first value that is not finite, after `run` has raised."""
        values: Values = {}
        with np.errstate(all="ignore"):
            for node, compute, _ in self.instructions:
                values[node] = compute(values, signals)
                if self.graph.pointwise[node] and not np.isfinite(values[node]).all():
                    bad = ~np.isfinite(values[node])
                    row = int(np.argmax(bad.any(axis=1)))
                    return node, self.steps[node][0] + int(np.argmax(bad[row])), row
        raise AssertionError("no expression fails")


def plan(graph: Graph, roots: Mapping[int, Steps], end: int, given: Iterable[int] = ()) -> Plan:
    """Plan the values of `roots` at their steps, on slices that end before step `end`.

    `given` nodes need not be computed: `Plan.run` receives them, for exactly the steps that the plan asks
    for.
    """
    known = set(given)
    steps: dict[int, Steps] = {}

    def demand(node: int, wanted: Steps) -> None:
        if wanted[0] < wanted[1]:
            old = steps.get(node, wanted)
            steps[node] = min(old[0], wanted[0]), max(old[1], wanted[1])

    for node in graph.below(roots):
        if graph.ops[node].name in PARTIAL and node not in known:
            demand(node, (0, end))
    for node, wanted in roots.items():
        demand(node, wanted)
    for node in range(max(steps, default=-1), -1, -1):
        if node in steps and node not in known:
            for child, wanted in _demands(graph, node, steps[node], end):
                demand(child, wanted)
    order = [node for node in sorted(steps) if node not in known]
    last = {child: node for node in order for child in _reads(graph, node, steps, end)}
    dead: dict[int, list[int]] = {}
    for child, node in last.items():
        if child not in roots and child in steps:
            dead.setdefault(node, []).append(child)
    instructions = tuple(
        (node, _compute(graph, node, steps, end), tuple(dead.get(node, ()))) for node in order
    )
    return Plan(graph, end, steps, instructions)


def _leaves(graph: Graph, root: int) -> list[int]:
    """The largest sub-formulas below `root` without temporal operators."""
    found: dict[int, None] = {}
    seen = set()
    stack = [root]
    while stack:
        node = stack.pop()
        if graph.pointwise[node]:
            found[node] = None
        elif node not in seen:
            seen.add(node)
            stack.extend(graph.ops[node].args)
    return list(found)


def _last_of(graph: Graph, op: Op) -> int | None:
    """The p of `F G p` and `G F p`, which on a finite slice is p at its last sample."""
    if op.name in {"always", "eventually"} and op.data == (None,):
        inner = graph.ops[op.args[0]]
        if inner.name in {"always", "eventually"} and inner.name != op.name and inner.data == (None,):
            return inner.args[0]
    return None


def _demands(graph: Graph, node: int, steps: Steps, end: int) -> list[tuple[int, Steps]]:
    """Which steps of which nodes the values of a node at [a, b) are computed from."""
    op, (a, b) = graph.ops[node], steps
    if graph.pointwise[node]:
        return [(child, steps) for child in op.args]
    match op.name, op.data:
        case "next", (int(k), _):
            return [(op.args[0], (a + k, min(b + k, end)))]
        case (("always" | "eventually"), (None,)):
            last = _last_of(graph, op)
            return [(op.args[0], (a, end))] if last is None else [(last, (end - 1, end))]
        case (("always" | "eventually"), ((int(low), int(high)),)):
            return [(op.args[0], (a + low, min(b + high, end)))]
        case "until", (None, False):
            return [(op.args[0], (a, end - 1)), (op.args[1], (a, end))]
        case "then", (None, False):
            return [(op.args[0], (a, end - 1)), (op.args[1], (a + 1, end))]
        case (("until" | "then"), (_, True)):
            return [*((leaf, (a, end - 1)) for leaf in _leaves(graph, op.args[0])), (op.args[1], (a, end))]
        case _:
            return [(child, steps) for child in op.args]


def _reads(graph: Graph, node: int, steps: Mapping[int, Steps], end: int) -> list[int]:
    return [child for child, _ in _demands(graph, node, steps[node], end)]


def _compute(graph: Graph, node: int, steps: Mapping[int, Steps], end: int) -> Compute:
    """The function that computes a node at its steps from its arguments at theirs."""
    op, (a, b) = graph.ops[node], steps[node]

    def reader(child: int, wanted: Steps) -> Callable[[Values], Array]:
        if graph.ops[child].name == "constant" or steps[child] == wanted:
            return lambda values: values[child]
        start, stop = wanted[0] - steps[child][0], wanted[1] - steps[child][0]
        return lambda values: values[child][:, start:stop]

    if op.name == "signal":
        name, part = op.data
        key = (str(name), part if isinstance(part, int) else None)
        return lambda _, signals: np.ascontiguousarray(signals[key][:, a:b])
    if op.name == "constant":
        value = np.asarray(graph.constant(node))
        return lambda *_: value
    demands = [
        (child, wanted) for child, wanted in _demands(graph, node, (a, b), end) if wanted[0] < wanted[1]
    ]
    reads = [reader(child, wanted) for child, wanted in demands]
    width = b - a
    if op.name not in _TEMPORAL:
        return lambda values, _: apply(op, [read(values) for read in reads])
    if op.name in {"until", "then"} and op.data[1]:
        return _truncated(graph, op, (a, b), steps, end)
    if not reads:  # nothing is left of the slice
        beyond = _EMPTY["eventually" if op.name == "then" or (op.name == "next" and op.data[1]) else op.name]
        return lambda _, signals: np.full((_count(signals), width), beyond)
    if op.name == "next":
        beyond = -np.inf if op.data[1] else np.inf
        return lambda values, _: scans.padded(reads[0](values), width, beyond)
    if op.name == "until":
        if len(reads) == 1:  # a slice of one sample: q at that one
            return lambda values, _: reads[0](values)
        if width == 1:
            return lambda values, _: scans.until_first(reads[0](values), reads[1](values))
        return lambda values, _: scans.until(reads[0](values), reads[1](values))[:, :width]
    if op.name == "then":
        # The largest p before t' is reached at some t'' < t': p T q = F (p & X[!] F q) for a p without temporal
        # operators. F q = q when q is itself an unbounded `then`.
        falls = graph.ops[op.args[1]].name == "then" and graph.ops[op.args[1]].data[0] is None
        later = (lambda q: q) if falls else partial(scans.suffixes, np.maximum)

        def then(values: Values, _: Signals) -> Array:
            pairs = np.minimum(reads[0](values), later(reads[1](values)))
            if width == 1:
                return scans.reduced(np.maximum, pairs)
            return scans.padded(scans.suffixes(np.maximum, pairs)[:, :width], width, -np.inf)

        return then
    fold, empty = _FOLDS[op.name], _EMPTY[op.name]
    (window,) = op.data
    if _last_of(graph, op) is not None:
        return lambda values, _: np.repeat(reads[0](values), width, axis=1) if width > 1 else reads[0](values)
    if window is None and width == 1:
        return lambda values, _: scans.reduced(fold, reads[0](values))
    if window is None:
        return lambda values, _: scans.suffixes(fold, reads[0](values))[:, :width]
    assert isinstance(window, tuple)
    low, high = window
    # The last windows stick out beyond the end; from a window of the whole length on they all do.
    size = min(high + 1, end) - low
    return lambda values, _: scans.windows(
        fold, scans.padded(reads[0](values), width + size - 1, empty), size
    )


def _count(signals: Signals) -> int:
    """How many trajectories."""
    return len(next(iter(signals.values())))


def _truncated(graph: Graph, op: Op, wanted: Steps, steps: Mapping[int, Steps], end: int) -> Compute:
    """U and T whose left operand holds temporal operators: it is evaluated on each slice [t, t') that it
    is read on."""
    (a, b), (p, q) = wanted, op.args
    window, fold, empty = op.data[0], _FOLDS[op.name], _EMPTY[op.name]
    low, high = window if isinstance(window, tuple) else (0, end)
    leaves = _leaves(graph, p)
    plans = {stop: plan(graph, {p: (a, stop)}, stop, leaves) for stop in range(a + 1, end)}

    def compute(values: Values, signals: Signals) -> Array:
        right = values[q][:, a - steps[q][0] : end - steps[q][0]]
        out = np.full((len(right), b - a), -np.inf)
        # `stop` is the t' of the definition; it concerns those t for which it lies in t + [low, high].
        for stop in range(a + low, end):
            first, last = max(a, stop - high), min(b, stop - low + 1)
            if first >= last:
                continue
            held = np.full((len(right), last - first), empty)
            strict = min(last, stop) - first  # the t < t'; at t = t' nothing has to hold
            if strict > 0:
                inner = plans[stop]
                given = {
                    leaf: values[leaf][:, s[0] - steps[leaf][0] : s[1] - steps[leaf][0]]
                    for leaf in leaves
                    if (s := inner.steps.get(leaf)) is not None
                }
                before = inner.run(signals, given)[p]
                held[:, :strict] = scans.suffixes(fold, before[:, first - a :])[:, :strict]
            part = out[:, first - a : last - a]
            np.maximum(part, np.minimum(held, right[:, stop - a, None]), out=part)
        return out

    return compute
