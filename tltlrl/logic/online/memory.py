"""Evaluates operators of the past sample by sample, and remembers only what each of them needs."""

from collections import deque
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic.graph import FOREVER, PAST, Array, Graph, Op, apply
from tltlrl.logic.online.sheet import Layout

_BEFORE = {"historically": np.inf, "once": -np.inf, "since": -np.inf}


class NotFiniteError(Exception):
    """A node has no finite value; it holds the node and the first trajectory where that is so."""

    def __init__(self, node: int, row: int) -> None:
        super().__init__(node, row)
        self.node, self.row = node, row


class Memory:
    """The memory of a graph's nodes that look back.

    Attributes:
      count: number of trajectories.
      layout: layout of the nodes that do not look back.
      rows: the row of each node in the values.
    """

    def __init__(
        self, graph: Graph, roots: Iterable[int], count: int, layout_of: Callable[[Iterable[int]], Layout]
    ) -> None:
        self._graph, self.count = graph, count
        roots = set(roots)
        below = graph.below(roots)
        self._nodes = [node for node in below if graph.looks_back[node]]
        needed = {*roots, *(arg for node in self._nodes for arg in graph.ops[node].args)}
        self.layout = layout_of(node for node in needed if not graph.looks_back[node])
        self.rows = {**self.layout.rows, **{node: i for i, node in enumerate(self._nodes, len(self.layout.rows))}}
        # For each operator of the past, the values that it may need again, the oldest first.
        self._kept: dict[int, deque[Array]] = {node: deque(maxlen=_length(graph.ops[node])) for node in self._nodes}

    def values(self, present: Array) -> Array:
        """The values of all nodes at the next sample, (rows, N), from the layout's values; it remembers nothing yet.

        Raises:
          NotFiniteError: where arithmetic has no finite value.
        """
        if not self._nodes:
            return present
        values = np.empty((len(self.rows), self.count))
        values[: len(present)] = present
        with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
            for row, node in enumerate(self._nodes, start=len(present)):
                op = self._graph.ops[node]
                args = [values[self.rows[arg]] for arg in op.args]
                if op.name in PAST:
                    values[row] = self._past(op, self._kept[node], args)
                    continue
                try:
                    apply(op, args, values[row])
                except FloatingPointError:
                    with np.errstate(all="ignore"):
                        raise NotFiniteError(node, int(np.argmin(np.isfinite(apply(op, args))))) from None
        return values

    def remember(self, values: Array) -> None:
        """Remembers the values at the last sample."""
        for node, kept in self._kept.items():
            op = self._graph.ops[node]
            if op.name in PAST:
                accumulates = op.name == "since" or op.data == (None,)
                kept.append(values[self.rows[node if accumulates else op.args[0]]].copy())

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Keeps the memory of these trajectories only."""
        self.count = len(rows)
        for kept in self._kept.values():
            kept.extend([kept.popleft()[rows] for _ in range(len(kept))])

    def state(self) -> list[Array]:
        """The whole memory, a list of (N,) of fixed length; NaN where there was no sample yet."""
        parts = []
        for node, kept in self._kept.items():
            if self._graph.ops[node].name in PAST:
                parts += [*kept, *[np.full(self.count, np.nan)] * ((kept.maxlen or 0) - len(kept))]
        return parts

    def _past(self, op: Op, kept: deque[Array], args: list[Array]) -> Array:
        match op.name, op.data:
            case "lag", _:
                return kept[-1] if kept else args[0]
            case "previous", (int(steps), bool(strong)):
                if len(kept) == steps:
                    return kept[0]
                return np.full(self.count, -np.inf if strong else np.inf)
            case "since", _:
                before = kept[-1] if kept else np.full(self.count, -np.inf)
                return np.maximum(args[1], np.minimum(args[0], before))
            case ((("once" | "historically") as name), (window,)):
                fold = np.maximum if name == "once" else np.minimum
                if not isinstance(window, tuple):
                    return fold(args[0], kept[-1]) if kept else args[0]
                low, _ = window
                seen = [*kept, args[0]]
                return fold.reduce(seen[: max(len(seen) - low, 0)] or [np.full(self.count, _BEFORE[name])])
        raise AssertionError(op)


def _length(op: Op) -> int:
    """How many samples an operator of the past keeps."""
    match op.name, op.data:
        case "previous", (int(steps), _):
            return steps
        case (("once" | "historically"), ((_, int(high)),)):
            assert high < FOREVER
            return high
    return 1
