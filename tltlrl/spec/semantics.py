"""Robustness of a graph on batches of trajectories of one length.

Arrays are time-major, (steps, trajectories): every operation then runs along contiguous rows. Each node is
computed only at the steps that the wanted values depend on: a root F or G is one reduction, `F G p` is p at
the last sample, a bounded formula looks at its horizon. What is wanted where depends on the length alone,
so a plan is made once per length and reused.

Time is linear in trajectories, steps and nodes; windows of any width cost the same. Only a left operand of
U or T that holds temporal operators is evaluated once for each possible end of its slice, which costs
steps^2 (and once more that factor for such an operand inside such an operand).
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tltlrl.spec.graph import PARTIAL, Array, Graph, Op, apply

Steps = tuple[int, int]  # half-open
Values = dict[int, Array]
Signals = Mapping[tuple[str, int | None], Array]
Fold = Any  # np.minimum or np.maximum; a np.ufunc, whose methods NumPy does not type
Compute = Callable[[Values, Signals], Array]

_FOLDS = {"always": np.minimum, "eventually": np.maximum, "until": np.minimum, "then": np.maximum}
_EMPTY = {"always": np.inf, "eventually": -np.inf, "until": np.inf, "then": -np.inf}
# Up to this width a sliding extreme by doubling beats the two scans that are independent of the width.
_NARROW = 64


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
                    bad = ~np.isfinite(np.atleast_2d(values[node]))
                    row = int(np.argmax(bad.any(axis=0)))
                    return node, self.steps[node][0] + int(np.argmax(bad[:, row])), row
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
    instructions = tuple((node, _compute(graph, node, steps, end), tuple(dead.get(node, ()))) for node in order)
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
        return lambda values: values[child][start:stop]

    if op.name == "signal":
        name, part = op.data
        key = (str(name), part if isinstance(part, int) else None)
        return lambda _, signals: np.ascontiguousarray(signals[key][a:b])
    if op.name == "constant":
        value = np.asarray(graph.constant(node))
        return lambda *_: value
    demands = [(child, wanted) for child, wanted in _demands(graph, node, (a, b), end) if wanted[0] < wanted[1]]
    reads = [reader(child, wanted) for child, wanted in demands]
    if op.name not in {"next", "always", "eventually", "until", "then"}:
        return lambda values, _: apply(op, [read(values) for read in reads])
    width = b - a
    if op.name == "next":
        beyond = -np.inf if op.data[1] else np.inf
        if not reads:
            return lambda _, signals: np.full((width, _count(signals)), beyond)
        (shifted,) = reads
        return lambda values, _: _padded(shifted(values), width, beyond)
    if op.name in {"always", "eventually"}:
        fold, empty = _FOLDS[op.name], _EMPTY[op.name]
        if not reads:
            return lambda _, signals: np.full((width, _count(signals)), empty)
        (read,) = reads
        (window,) = op.data
        if _last_of(graph, op) is not None:
            return lambda values, _: np.repeat(read(values), width, axis=0) if width > 1 else read(values)
        if window is None:
            return lambda values, _: _suffixes(fold, read(values), width)
        assert isinstance(window, tuple)
        low, high = window
        size = high - low + 1
        return lambda values, _: _windows(fold, read(values), width, size, empty)
    if op.data[1]:
        return _truncated(graph, op, (a, b), steps, end)
    if op.name == "until":
        if len(reads) == 1:  # a slice of one sample: q at that one
            return lambda values, _: reads[0](values)
        return lambda values, _: _until(reads[0](values), reads[1](values), width)
    if not reads:  # a slice of one sample has no two
        return lambda _, signals: np.full((width, _count(signals)), -np.inf)
    return lambda values, _: _then(reads[0](values), reads[1](values), width)


def _count(signals: Signals) -> int:
    """How many trajectories."""
    return len(next(iter(signals.values()))[0])


def _padded(x: Array, steps: int, filler: float) -> Array:
    """`x`, lengthened to `steps` rows."""
    if len(x) == steps:
        return x
    out: Array = np.empty((steps, x.shape[1]))
    out[: len(x)] = x
    out[len(x) :] = filler
    return out


def _reduced(fold: Fold, x: Array) -> Array:
    """The fold over all rows, as one row."""
    row: Array = fold.reduce(x, axis=0, keepdims=True)
    return row


def _suffixes(fold: Fold, x: Array, width: int) -> Array:
    """Row t of the result is the fold over rows t, t+1, ... of x; for the first `width` t."""
    if width == 1:
        return _reduced(fold, x)
    return _scan(fold, x[::-1])[::-1][:width]


def _scan(fold: Fold, x: Array) -> Array:
    """`fold.accumulate(x, axis=0)`, in blocks of about sqrt(T) rows when rows are long enough for that to
    be faster.

    `accumulate` works one number at a time; here all blocks advance together, then each takes over its
    predecessor.
    """
    steps, count = x.shape
    if steps * count * count < 90_000 or steps < 16:
        out: Array = fold.accumulate(x, axis=0)
        return out
    size = int(np.sqrt(steps))
    blocks, rest = divmod(steps, size)
    out = np.empty_like(x)
    block = out[: blocks * size].reshape(blocks, size, count)
    source = x[: blocks * size].reshape(blocks, size, count)
    block[:, 0] = source[:, 0]
    for i in range(1, size):
        fold(block[:, i - 1], source[:, i], out=block[:, i])
    for k in range(1, blocks):
        fold(block[k], block[k - 1, -1], out=block[k])
    if rest:
        tail = out[blocks * size :]
        fold.accumulate(x[blocks * size :], axis=0, out=tail)
        fold(tail, out[blocks * size - 1], out=tail)
    return out


def _windows(fold: Fold, x: Array, width: int, size: int, empty: float) -> Array:
    """Row t of the result is the fold over rows t .. t + size - 1 of x, as far as they exist; `width`
    rows."""
    if size >= len(x):
        return _padded(_suffixes(fold, x, min(width, len(x))), width, empty)
    if width == 1:
        return _reduced(fold, x[:size])
    x = _padded(x, width + size - 1, empty)
    if size <= _NARROW:
        # Two windows of length 2^k, one at each end, cover the whole.
        span = 1
        while 2 * span <= size:
            x = fold(x[:-span], x[span:])
            span *= 2
        covered: Array = fold(x[:width], x[size - span : size - span + width])
        return covered
    # van Herk, Gil and Werman: cut into blocks of `size`; a window is the tail of one block and the head
    # of the next.
    blocks = -(-len(x) // size)
    x = _padded(x, blocks * size, empty).reshape(blocks, size, -1)
    heads = fold.accumulate(x, axis=1).reshape(blocks * size, -1)
    tails = fold.accumulate(x[:, ::-1], axis=1)[:, ::-1].reshape(blocks * size, -1)
    windows: Array = fold(tails[:width], heads[size - 1 : size - 1 + width])
    return windows


def _until(p: Array, q: Array, width: int) -> Array:
    """p U q on the first `width` suffixes, from p without its last row and q."""
    if width == 1:
        held = np.minimum(_scan(np.minimum, p), q[1:])
        return np.maximum(_reduced(np.maximum, held), q[:1])
    # y_t = max(q_t, min(p_t, y_{t+1})). In blocks of about sqrt(T) steps: first every block at once as if
    # nothing followed it (y), with the min of p from t to its end (through); then the blocks take over
    # from the next one.
    steps, count = q.shape
    size = max(1, int(np.sqrt(steps)))
    blocks = -(-steps // size)
    p = _padded(p, blocks * size, -np.inf).reshape(blocks, size, count)
    y = _padded(q, blocks * size, -np.inf).reshape(blocks, size, count).copy()
    through = p.copy()
    for i in range(size - 2, -1, -1):
        np.maximum(y[:, i], np.minimum(p[:, i], y[:, i + 1]), out=y[:, i])
        np.minimum(through[:, i], through[:, i + 1], out=through[:, i])
    for k in range(blocks - 2, -1, -1):
        np.maximum(y[k], np.minimum(through[k], y[k + 1, 0]), out=y[k])
    return y.reshape(blocks * size, count)[:width]


def _then(p: Array, q: Array, width: int) -> Array:
    """p T q on the first `width` suffixes, from p without its last row and q without its first.

    For formulas without temporal operators on the left: the largest p before t' is reached at some t'' <
    t', so p T q = F (p & X[!] F q).
    """
    pairs = np.minimum(p, _suffixes(np.maximum, q, len(q)))
    return _padded(_suffixes(np.maximum, pairs, min(width, len(pairs))), width, -np.inf)


def _truncated(graph: Graph, op: Op, wanted: Steps, steps: Mapping[int, Steps], end: int) -> Compute:
    """U and T whose left operand holds temporal operators: it is evaluated on each slice [t, t') that it
    is read on."""
    (a, b), (p, q) = wanted, op.args
    window, fold, empty = op.data[0], _FOLDS[op.name], _EMPTY[op.name]
    low, high = window if isinstance(window, tuple) else (0, end)
    leaves = _leaves(graph, p)
    plans = {stop: plan(graph, {p: (a, stop)}, stop, leaves) for stop in range(a + 1, end)}

    def compute(values: Values, signals: Signals) -> Array:
        right = values[q][a - steps[q][0] : end - steps[q][0]]
        out = np.full((b - a, right.shape[1]), -np.inf)
        for stop in range(a + low, end):  # the t' of the definition; t runs over those with t' in t + [low, high]
            first, last = max(a, stop - high), min(b, stop - low + 1)
            if first >= last:
                continue
            held = np.full((last - first, right.shape[1]), empty)
            if stop > a:
                inner = plans[stop]
                given = {
                    leaf: values[leaf][s[0] - steps[leaf][0] : s[1] - steps[leaf][0]]
                    for leaf in leaves
                    if (s := inner.steps.get(leaf)) is not None
                }
                before = inner.run(signals, given)[p]
                strict = min(last, stop) - first
                if strict > 0:
                    held[:strict] = _suffixes(fold, before[first - a :], strict)
            np.maximum(out[first - a : last - a], np.minimum(held, right[stop - a]), out=out[first - a : last - a])
        return out

    return compute
