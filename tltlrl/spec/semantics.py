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
from operator import itemgetter

import numpy as np

from tltlrl.spec import scans
from tltlrl.spec.graph import PARTIAL, UFUNCS, Array, Graph, Op, apply

Steps = tuple[int, int]  # half-open
Values = dict[int, Array]
Signals = Mapping[tuple[str, int | None], Array]
Compute = Callable[[Values, Signals, "Workspace"], Array]

# What has to hold before the first step.
_HELD = {"until": np.inf, "then": -np.inf}
# What is left when a slice is exhausted; the flag is that of a strong next.
_EMPTY = {
    ("next", False): np.inf,
    ("next", True): -np.inf,
    ("always", False): np.inf,
    ("eventually", False): -np.inf,
    ("until", False): -np.inf,
    ("then", False): -np.inf,
}


class Workspace:
    """Arrays that are used again and again: memory that is already in the cache, and in the process.

    Taking and giving back are single operations on a list, so that threads may share one.
    """

    def __init__(self, size: int) -> None:
        self.size, self.free = size, list[Array]()

    def take(self, count: int, steps: int) -> Array:
        """An uninitialised (count, steps) array."""
        try:
            flat = self.free.pop()
        except IndexError:
            flat = np.empty(self.size)
        return flat[: count * steps].reshape(count, steps)

    def give(self, x: Array) -> None:
        """Take back an array that nobody reads any more, if it came from here."""
        if isinstance(x.base, np.ndarray) and x.base.shape == (self.size,):
            self.free.append(x.base)


@dataclass(frozen=True, slots=True)
class Plan:
    """How to compute some nodes on trajectories of one length: instructions in order, what to forget when."""

    graph: Graph
    roots: tuple[int, ...]
    steps: Mapping[int, Steps]  # node -> the steps it is computed at
    instructions: tuple[tuple[int, Compute, tuple[int, ...]], ...]
    constants: Mapping[int, Array]
    workspace: Workspace

    def run(self, signals: Signals, given: Values | None = None, workspace: Workspace | None = None) -> Values:
        """The values of the plan's roots. Raises FloatingPointError where an expression has no finite value."""
        values: Values = {**self.constants, **(given or {})}
        space = workspace or self.workspace
        with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
            for node, compute, dead in self.instructions:
                values[node] = compute(values, signals, space)
                for forgotten in dead:
                    space.give(values.pop(forgotten))
        return {root: values[root] for root in self.roots}

    def failure(self, signals: Signals) -> tuple[int, int, int]:
        """Node, step and trajectory of the first value that is not finite, after `run` has raised."""
        values: Values = {**self.constants}
        with np.errstate(all="ignore"):
            for node, compute, _ in self.instructions:
                values[node] = compute(values, signals, self.workspace)
                if self.graph.pointwise[node] and not np.isfinite(values[node]).all():
                    bad = ~np.isfinite(values[node])
                    row = int(np.argmax(bad.any(axis=1)))
                    return node, self.steps[node][0] + int(np.argmax(bad[row])), row
        raise AssertionError("no expression fails")


def plan(graph: Graph, roots: Mapping[int, Steps], end: int, given: Iterable[int] = (), block: int = 0) -> Plan:
    """Plan the values of `roots` at their steps, on slices that end before step `end`.

    `given` nodes need not be computed: `Plan.run` receives them, for exactly the steps that the plan asks for.
    `block` is the number of samples of a signal that a run will get at most.
    """
    known = set(given)
    steps: dict[int, Steps] = {}

    def demand(node: int, wanted: Steps) -> None:
        if wanted[0] < wanted[1]:
            old = steps.get(node, wanted)
            steps[node] = min(old[0], wanted[0]), max(old[1], wanted[1])

    for node in graph.below(roots, known):
        if graph.pointwise[node] and graph.ops[node].name in PARTIAL:
            demand(node, (0, end))
    for node, wanted in roots.items():
        demand(node, wanted)
    for node in range(max(steps, default=-1), -1, -1):
        if node in steps and node not in known:
            for child, wanted in _demands(graph, node, steps[node], end):
                demand(child, wanted)
    constants = {n: np.asarray(graph.constant(n)) for n in steps if graph.ops[n].name == "constant"}
    order = [node for node in sorted(steps) if node not in known and node not in constants]
    kept = {*roots, *known, *constants}
    last = {child: node for node in order for child, _ in _demands(graph, node, steps[node], end)}
    dead: dict[int, list[int]] = {node: [] for node in order}
    for child, node in last.items():
        if child in steps and child not in kept:
            dead[node].append(child)
    return Plan(
        graph,
        tuple(roots),
        steps,
        tuple((node, _compute(graph, node, steps, end, node in roots), tuple(dead[node])) for node in order),
        constants,
        Workspace(max(block, end)),
    )


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


def _compute(graph: Graph, node: int, steps: Mapping[int, Steps], end: int, fresh: bool) -> Compute:
    """The function that computes a node at its steps from its arguments at theirs.

    Its result shares no memory with its arguments; a `fresh` one none with the workspace either.
    """
    op, (a, b) = graph.ops[node], steps[node]
    width = b - a

    def reader(child: int, wanted: Steps) -> Callable[[Values], Array]:
        if graph.ops[child].name == "constant" or steps[child] == wanted:
            return itemgetter(child)
        start, stop = wanted[0] - steps[child][0], wanted[1] - steps[child][0]
        return lambda values: values[child][:, start:stop]

    demands = _demands(graph, node, (a, b), end)
    reads = [reader(child, wanted) for child, wanted in demands if wanted[0] < wanted[1]]

    def room(signals: Signals, space: Workspace) -> Array:
        count = len(next(iter(signals.values())))
        return np.empty((count, width)) if fresh or width == 1 else space.take(count, width)

    if op.name == "signal":
        name, part = op.data
        key = (str(name), part if isinstance(part, int) else None)

        def copy_signal(_: Values, signals: Signals, space: Workspace) -> Array:
            out = room(signals, space)
            out[:] = signals[key][:, a:b]
            return out

        return copy_signal
    if op.name in UFUNCS and len(reads) == 2:
        (first, second), ufunc = reads, UFUNCS[op.name]
        if width == 1:  # too small to be worth a place in the workspace
            return lambda values, *_: ufunc(first(values), second(values))

        def binary(values: Values, signals: Signals, space: Workspace) -> Array:
            result: Array = ufunc(first(values), second(values), out=room(signals, space))
            return result

        return binary
    if graph.pointwise[node] or op.name in UFUNCS:

        def pointwise(values: Values, signals: Signals, space: Workspace) -> Array:
            out = room(signals, space)
            scratch = space.take(*out.shape) if op.name in {"norm", "squares"} else None
            apply(op, [read(values) for read in reads], out, scratch)
            if scratch is not None:
                space.give(scratch)
            return out

        return pointwise
    if op.data[-1] is True and op.name in {"until", "then"}:
        return _truncated(graph, op, (a, b), steps, end)
    temporal = _temporal(graph, op, width, end)

    def beyond(_: Values, signals: Signals, space: Workspace) -> Array:
        out = room(signals, space)
        out[:] = _EMPTY[op.name, op.data[-1] is True]
        return out

    if not reads:
        return beyond

    def read_all(values: Values, signals: Signals, space: Workspace) -> Array:
        out = room(signals, space)
        temporal([read(values) for read in reads], out)
        return out

    return read_all


def _temporal(graph: Graph, op: Op, width: int, end: int) -> Callable[[list[Array], Array], object]:
    """The function that writes `width` columns of a temporal operator from its arguments' columns."""
    empty = _EMPTY[op.name, op.data[-1] is True]
    if op.name == "next":

        def shift(args: list[Array], out: Array) -> None:
            reach = args[0].shape[1]
            out[:, :reach] = args[0]
            out[:, reach:] = empty

        return shift
    if op.name == "until":

        def until(args: list[Array], out: Array) -> None:
            if len(args) == 1:  # a slice of one sample: q at that one
                out[:] = args[0]
            elif width == 1:
                p, q = args
                held = np.minimum.accumulate(p, axis=1)
                np.maximum(scans.reduced(np.maximum, np.minimum(held, q[:, 1:], out=held)), q[:, :1], out=out)
            else:
                out[:] = scans.until(*args)[:, :width]

        return until
    if op.name == "then":
        # The largest p before t' is reached at some t'' < t': p T q = F (p & X[!] F q) for a p without temporal
        # operators. F q is q when q is itself an unbounded T or F.
        second = graph.ops[op.args[1]]
        is_falling = second.name in {"then", "eventually"} and second.data[0] is None

        def then(args: list[Array], out: Array) -> None:
            p, q = args
            later = q if is_falling else scans.suffixes(np.maximum, q)
            pairs = np.minimum(p, later)
            reach = min(width, p.shape[1])
            out[:, :reach] = (
                scans.suffixes(np.maximum, pairs)[:, :reach] if width > 1 else scans.reduced(np.maximum, pairs)
            )
            out[:, reach:] = -np.inf

        return then
    if _last_of(graph, op) is not None:
        return lambda args, out: np.copyto(out, args[0])
    (window,), fold = op.data, np.minimum if op.name == "always" else np.maximum
    if window is None:

        def suffixes(args: list[Array], out: Array) -> None:
            x = args[0]
            if width == 1:
                fold.reduce(x, axis=1, keepdims=True, out=out)
            elif width == x.shape[1]:
                scans.suffixes(fold, x, out)
            else:
                out[:] = scans.suffixes(fold, x)[:, :width]

        return suffixes
    assert isinstance(window, tuple)
    low, high = window
    # The last windows stick out beyond the end; from a window of the whole length on they all do.
    size = min(high + 1, end) - low
    return lambda args, out: np.copyto(out, scans.windows(fold, scans.padded(args[0], width + size - 1, empty), size))


def _truncated(graph: Graph, op: Op, wanted: Steps, steps: Mapping[int, Steps], end: int) -> Compute:
    """U and T whose left operand holds temporal operators: it is evaluated on each slice [t, t') that it
    is read on."""
    (a, b), (p, q) = wanted, op.args
    window, fold, empty = op.data[0], np.minimum if op.name == "until" else np.maximum, _HELD[op.name]
    low, high = window if isinstance(window, tuple) else (0, end)
    leaves = _leaves(graph, p)
    plans = {stop: plan(graph, {p: (a, stop)}, stop, leaves) for stop in range(a + 1, end)}

    def compute(values: Values, signals: Signals, space: Workspace) -> Array:
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
                before = inner.run(signals, given, space)[p]
                held[:, :strict] = scans.suffixes(fold, before[:, first - a :])[:, :strict]
            part = out[:, first - a : last - a]
            np.maximum(part, np.minimum(held, right[:, stop - a, None]), out=part)
        return out

    return compute
