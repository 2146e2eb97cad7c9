"""Robustness of a graph on batches of trajectories of one length.

Arrays are (trajectories, steps). Each node is computed only at the steps that the wanted values depend on: a root
F or G is one reduction, `F G p` is p at the last sample, a bounded formula looks at its horizon. Which values are
needed depends only on the length, so there is one plan per length. A program binds the operations of a plan to arrays,
for one number of trajectories. Running a program costs little more than its NumPy calls.

Time is linear in trajectories, steps and nodes. The width of a window changes it by a constant factor at most. The
exception is a left operand of U or T that holds temporal operators: it is evaluated once for each possible end of its
slice, which costs steps^2 (and another factor of steps for every such operand nested in it).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

import numpy as np

from tltlrl.logic import scans
from tltlrl.logic.graph import ARITHMETIC, PARTIAL, PAST, POINTWISE, SELECTING, UFUNCS, Array, Graph, Op, apply

Steps = tuple[int, int]  # half-open
Values = dict[int, Array]
Signals = Mapping[tuple[str, int | None], Array]
Operation = Callable[[], object]
Borrow = Callable[[int], Array]  # a number of steps => an array that holds nothing before and after the operation
_KEPT = 4  # numbers of trajectories that a plan keeps programs for

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
    ("previous", False): np.inf,
    ("previous", True): -np.inf,
    ("historically", False): np.inf,
    ("once", False): -np.inf,
}


@dataclass(frozen=True, slots=True)
class Program:
    """A plan for one number of trajectories: all arrays are allocated, and every operation is bound to its own."""

    inputs: tuple[tuple[tuple[str, int | None], Steps, Array], ...]
    operations: tuple[tuple[int, Operation], ...]
    arrays: Mapping[int, Array]  # those of nodes that are dead at the end are overwritten by later nodes
    holds_squares: bool

    def run(self, signals: Signals) -> None:
        """Fill the arrays.

        Raises:
          FloatingPointError: where an expression has no finite value, or a square is too small for a float.
        """
        for key, (start, stop), array in self.inputs:
            array[:] = signals[key][:, start:stop]
        under: Literal["raise", "ignore"] = "raise" if self.holds_squares else "ignore"
        with np.errstate(divide="raise", over="raise", invalid="raise", under=under):
            for _, operation in self.operations:
                operation()


@dataclass(frozen=True, slots=True)
class Plan:
    """How to compute some nodes on trajectories of one length: the order of nodes, and when arrays are free again."""

    graph: Graph
    end: int
    roots: tuple[int, ...]
    steps: Mapping[int, Steps]  # node -> the steps it is computed at
    order: tuple[tuple[int, tuple[int, ...]], ...]
    programs: dict[int, list[Program]] = field(default_factory=dict)  # number of trajectories -> idle ones

    def run(self, signals: Signals) -> Values:
        """The values of the plan's roots.

        Programs are kept for the next call; each is used by one caller at a time.

        Raises:
          FloatingPointError: where an expression has no finite value.
        """
        count = len(next(iter(signals.values())))
        idle = self.programs.setdefault(count, [])
        try:
            program = idle.pop()
        except IndexError:
            program = self.program(count, {})
        program.run(signals)
        values = {root: program.arrays[root].copy() for root in self.roots}
        if len(self.programs) <= _KEPT:
            idle.append(program)
        else:
            self.programs.clear()
        return values

    def program(self, count: int, given: Values) -> Program:
        """The plan for `count` trajectories. `given` are the values of nodes that it does not compute."""
        arrays: Values = dict(given)
        inputs, operations = [], []
        free: list[Array] = []
        largest = count * max((b - a for a, b in self.steps.values()), default=0)

        def take(steps: int) -> Array:
            flat = free.pop() if free else np.empty(largest)
            return flat[: count * steps].reshape(count, steps)

        def give(array: Array) -> None:
            if isinstance(array.base, np.ndarray):
                free.append(array.base)

        for node, dead in self.order:
            op, (a, b) = self.graph.ops[node], self.steps[node]
            if op.name == "constant":
                value = self.graph.constant(node)
                arrays[node] = np.full((count, b - a), value) if node in self.roots else np.asarray(value)
                continue
            # A signal's array is filled before all operations: none may have it before.
            out = np.empty((count, b - a)) if node in self.roots or op.name == "signal" else take(b - a)
            arrays[node] = out
            if op.name == "signal":
                name, part = op.data
                inputs.append(((str(name), part if isinstance(part, int) else None), (a, b), out))
            else:
                borrowed: list[Array] = []

                def borrow(steps: int, borrowed: list[Array] = borrowed) -> Array:
                    borrowed.append(take(steps))
                    return borrowed[-1]

                operations.append((node, _operation(self.graph, node, self.steps, self.end, arrays, out, borrow)))
                for array in borrowed:
                    give(array)
            for forgotten in dead:
                give(arrays[forgotten])
        holds_squares = any(self.graph.ops[node].name == "squares" for node, _ in operations)
        return Program(tuple(inputs), tuple(operations), arrays, holds_squares)

    def failure(self, signals: Signals) -> tuple[int, int, int]:
        """Node, step and trajectory of the first value that is not finite, after `run` has raised."""
        program = self.program(len(next(iter(signals.values()))), {})
        for key, (start, stop), array in program.inputs:
            array[:] = signals[key][:, start:stop]
        with np.errstate(all="ignore"):
            for node, operation in program.operations:
                operation()
                bad = ~np.isfinite(program.arrays[node])
                if bad.any() and self.graph.ops[node].name in ARITHMETIC - SELECTING:
                    row = int(np.argmax(bad.any(axis=1)))
                    return node, self.steps[node][0] + int(np.argmax(bad[row])), row
        raise AssertionError("no expression fails")


def plan(graph: Graph, roots: Mapping[int, Steps], end: int, given: Iterable[int] = ()) -> Plan:
    """Plan the values of `roots` at their steps, on slices that end before step `end`.

    `given` nodes are not computed: `Plan.program` receives them, for exactly the steps that the plan asks for.
    """
    known = set(given)
    steps: dict[int, Steps] = {}

    def demand(node: int, wanted: Steps) -> None:
        if wanted[0] < wanted[1]:
            old = steps.get(node, wanted)
            steps[node] = min(old[0], wanted[0]), max(old[1], wanted[1])

    for node in graph.below(roots, known):
        if graph.local[node] and graph.ops[node].name in PARTIAL:
            demand(node, (0, end))
    for node, wanted in roots.items():
        demand(node, wanted)
    for node in range(max(steps, default=-1), -1, -1):
        if node in steps and node not in known:
            for child, wanted in _demands(graph, node, steps[node], end):
                demand(child, wanted)
    order = [node for node in sorted(steps) if node not in known]
    kept = {*roots, *known}
    last = {child: node for node in order for child, _ in _demands(graph, node, steps[node], end)}
    dead: dict[int, list[int]] = {node: [] for node in order}
    for child, node in last.items():
        # A signal's array is filled before all operations and so is never lent to another node.
        if child in steps and child not in kept and graph.ops[child].name not in {"constant", "signal"}:
            dead[node].append(child)
    return Plan(graph, end, tuple(roots), steps, tuple((node, tuple(dead[node])) for node in order))


def _leaves(graph: Graph, root: int) -> list[int]:
    """The largest sub-formulas below `root` whose values are the same on all slices, but constants."""
    found: dict[int, None] = {}
    seen = set()
    stack = [root]
    while stack:
        node = stack.pop()
        if graph.local[node]:
            if graph.ops[node].name != "constant":
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
    if op.name in POINTWISE:
        return [(child, steps) for child in op.args]
    match op.name, op.data:
        case "next", (int(k), _):
            return [(op.args[0], (a + k, min(b + k, end)))]
        case (("always" | "eventually"), (None,)):
            last = _last_of(graph, op)
            return [(op.args[0], (a, end))] if last is None else [(last, (end - 1, end))]
        case (("always" | "eventually"), ((int(low), int(high)),)):
            return [(op.args[0], (a + low, min(b + high, end)))]
        case "second", _:
            return [(op.args[0], (a, end))]
        case "lag", _:
            return [(op.args[0], (max(a - 1, 0), max(b - 1, 1)))]
        case "previous", (int(k), _):
            return [(op.args[0], (max(a - k, 0), b - k))]
        case (("once" | "historically"), (None,)):
            return [(op.args[0], (0, b))]
        case (("once" | "historically"), ((int(low), int(high)),)):
            return [(op.args[0], (max(a - high, 0), b - low))]
        case "since", _:
            return [(op.args[0], (1, b)), (op.args[1], (0, b))]
        case "until", (None, False):
            return [(op.args[0], (a, end - 1)), (op.args[1], (a, end))]
        case "then", (None, False):
            return [(op.args[0], (a, end - 1)), (op.args[1], (a + 1, end))]
        case "then", (_, False):
            return [(op.args[0], (a, end - 1)), (op.args[1], (a, end))]
        case (("until" | "then"), (_, True)):
            first = 0 if graph.looks_back[op.args[0]] else a
            return [*((leaf, (first, end - 1)) for leaf in _leaves(graph, op.args[0])), (op.args[1], (a, end))]
        case _:
            return [(child, steps) for child in op.args]


def _operation(
    graph: Graph, node: int, steps: Mapping[int, Steps], end: int, arrays: Values, out: Array, borrow: Borrow
) -> Operation:
    """The function that writes a node's values to `out`, from the arrays of its arguments; what it borrows is free."""
    op, (a, b) = graph.ops[node], steps[node]
    demands = [(child, wanted) for child, wanted in _demands(graph, node, (a, b), end) if wanted[0] < wanted[1]]

    def view(child: int, wanted: Steps) -> Array:
        if not arrays[child].ndim:  # a constant
            return arrays[child] if op.name in POINTWISE else np.full((len(out), wanted[1] - wanted[0]), arrays[child])
        return arrays[child][:, wanted[0] - steps[child][0] : wanted[1] - steps[child][0]]

    if op.name in {"until", "then"} and op.data[1] is True:
        return partial(_truncated, graph, op, (a, b), steps, end, arrays, out, _truncated_plans(graph, op, a, end))
    args = [view(child, wanted) for child, wanted in demands]
    if op.name in UFUNCS and len(args) <= 2:
        return partial(UFUNCS[op.name], *args, out=out)
    if op.name in ARITHMETIC:
        return partial(apply, op, args, out, borrow(b - a))
    if op.name == "second":
        return lambda: np.copyto(out, scans.second_smallest(args[0]))
    if op.name == "ends":
        (k,) = op.data
        assert isinstance(k, int)
        return partial(np.copyto, out, np.where(np.arange(a, b) + k >= end, np.inf, -np.inf))
    if not args:
        return partial(out.fill, _EMPTY[op.name, op.data[-1] is True])
    if op.name in PAST:
        return partial(_past(op, (a, b)), args, out)
    return partial(_temporal(graph, op, b - a, end, lambda: borrow(args[0].shape[1])), args, out)


def _past(op: Op, steps: Steps) -> Callable[[list[Array], Array], object]:
    """The function that writes the columns `steps` of an operator of the past from its arguments' columns."""
    (a, b), width = steps, steps[1] - steps[0]
    if op.name in {"lag", "previous"}:
        k = op.data[0] if op.data else 1
        assert isinstance(k, int)
        before = min(max(k - a, 0), width)  # columns that nothing precedes

        def shift(args: list[Array], out: Array) -> None:
            out[:, before:] = args[0][:, : width - before]
            out[:, :before] = args[0][:, :1] if op.name == "lag" else _EMPTY[op.name, op.data[1] is True]

        return shift
    if op.name == "since":

        def since(args: list[Array], out: Array) -> None:
            if len(args) == 1:  # the first sample alone
                out[:] = args[0]
            else:
                p, q = (np.ascontiguousarray(x[:, ::-1]) for x in args)
                out[:] = scans.until(p, q)[:, ::-1][:, a:]

        return since
    (window,), fold = op.data, np.minimum if op.name == "historically" else np.maximum
    if window is None:
        return lambda args, out: np.copyto(out, fold.accumulate(args[0], axis=1)[:, a:])
    assert isinstance(window, tuple)
    low, high = window
    high = min(high, b - 1)  # the first windows stick out before the start; from one of the whole length on they all do
    filler = _EMPTY[op.name, False]

    def windows(args: list[Array], out: Array) -> None:
        x = np.full((len(out), width + high - low), filler)
        x[:, x.shape[1] - args[0].shape[1] :] = args[0]
        np.copyto(out, scans.windows(fold, x, high - low + 1))

    return windows


def _temporal(
    graph: Graph, op: Op, width: int, end: int, borrow: Callable[[], Array]
) -> Callable[[list[Array], Array], object]:
    """The function that writes `width` columns of a temporal operator from its arguments' columns.

    It may borrow arrays like its first argument.
    """
    empty = _EMPTY[op.name, op.data[-1] is True]
    if op.name == "next":

        def shift(args: list[Array], out: Array) -> None:
            reach = args[0].shape[1]
            out[:, :reach] = args[0]
            out[:, reach:] = empty

        return shift
    if op.name == "until":
        held, spare = (borrow(), borrow()) if width == 1 else (None, None)

        def until(args: list[Array], out: Array) -> None:
            if len(args) == 1:  # a slice of one sample: q at that one
                out[:] = args[0]
            elif held is not None and spare is not None:
                p, q = args
                scans.prefixes(np.minimum, p, held, spare)
                np.maximum(scans.reduced(np.maximum, np.minimum(held, q[:, 1:], out=held)), q[:, :1], out=out)
            else:
                out[:] = scans.until(*args)[:, :width]

        return until
    if op.name == "then" and op.data[0] is not None:
        low, high = op.data[0]  # type: ignore[misc]

        def bounded(args: list[Array], out: Array) -> None:
            out[:] = -np.inf
            if len(args) == 2:
                pairs = scans.pairs(args[0], args[1], low, high)
                reach = min(width, pairs.shape[1])
                out[:, :reach] = pairs[:, :reach]

        return bounded
    if op.name == "then":
        # The largest p before t' is reached at some t'' < t': p T q = F (p & X[!] F q) for a p without temporal
        # operators. F q is q when q is itself an unbounded T or F.
        second = graph.ops[op.args[1]]
        is_falling = second.name in {"then", "eventually"} and second.data[0] is None
        pairs, later, spare = borrow(), borrow(), borrow()

        def then(args: list[Array], out: Array) -> None:
            p, q = args
            np.minimum(p, q if is_falling else scans.suffixes(np.maximum, q, later, spare), out=pairs)
            reach = min(width, p.shape[1])
            if width > 1:
                out[:, :reach] = scans.suffixes(np.maximum, pairs, later, spare)[:, :reach]
            else:
                out[:, :reach] = scans.reduced(np.maximum, pairs)
            out[:, reach:] = -np.inf

        return then
    if _last_of(graph, op) is not None:
        return lambda args, out: np.copyto(out, args[0])
    (window,), fold = op.data, np.minimum if op.name == "always" else np.maximum
    if window is None:
        spare = borrow() if width > 1 else None

        def suffixes(args: list[Array], out: Array) -> None:
            x = args[0]
            if width == 1:
                fold.reduce(x, axis=1, keepdims=True, out=out)
            elif width == x.shape[1]:
                scans.suffixes(fold, x, out, spare)
            else:
                out[:] = scans.suffixes(fold, x)[:, :width]

        return suffixes
    assert isinstance(window, tuple)
    low, high = window
    # The last windows stick out beyond the end; from a window of the whole length on they all do.
    size = min(high + 1, end) - low
    return lambda args, out: np.copyto(out, scans.windows(fold, scans.padded(args[0], width + size - 1, empty), size))


def _truncated_plans(graph: Graph, op: Op, start: int, end: int) -> dict[int, Plan]:
    """For each possible end of the left operand's slice, how to compute that operand from its state formulas."""
    p, leaves = op.args[0], _leaves(graph, op.args[0])
    return {stop: plan(graph, {p: (start, stop)}, stop, leaves) for stop in range(start + 1, end)}


def _truncated(
    graph: Graph,
    op: Op,
    wanted: Steps,
    steps: Mapping[int, Steps],
    end: int,
    arrays: Values,
    out: Array,
    plans: Mapping[int, Plan],
) -> None:
    """U and T whose left operand holds temporal operators: it is evaluated on each slice that it is read on."""
    (a, b), (p, q) = wanted, op.args
    window, fold, empty = op.data[0], np.minimum if op.name == "until" else np.maximum, _HELD[op.name]
    low, high = window if isinstance(window, tuple) else (0, end)
    right = (
        np.full((len(out), end - a), arrays[q])
        if not arrays[q].ndim
        else arrays[q][:, a - steps[q][0] : end - steps[q][0]]
    )
    out[:] = -np.inf
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
                leaf: arrays[leaf][:, s[0] - steps[leaf][0] : s[1] - steps[leaf][0]]
                for leaf in _leaves(graph, p)
                if (s := inner.steps.get(leaf)) is not None
            }
            program = inner.program(len(right), given)
            program.run({})
            held[:, :strict] = scans.suffixes(fold, program.arrays[p][:, first - a :])[:, :strict]
        part = out[:, first - a : last - a]
        np.maximum(part, np.minimum(held, right[:, stop - a, None]), out=part)
