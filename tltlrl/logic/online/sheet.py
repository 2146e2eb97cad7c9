"""The values that one sample gives: nodes of a spec's graph that do not look back, alike ones computed as one array."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic.graph import UFUNCS, Array, Graph, Op, apply
from tltlrl.logic.semantics import Plan, Signals, plan

Rows = slice | NDArray[np.intp]  # of a sheet


@dataclass(frozen=True, slots=True)
class Layout:
    """Which node of a graph has which row of a sheet.

    Attributes:
      plan: of the wanted nodes, one after the other: says what is wrong with a sample, and knows all numbers.
      rows: node => row.
      signals: key and row of each.
      constants: row and value of each.
      alike: operation, rows of each of its arguments, rows of its values.
    """

    plan: Plan
    rows: Mapping[int, int]
    signals: tuple[tuple[tuple[str, int | None], int], ...]
    constants: tuple[tuple[int, float], ...]
    alike: tuple[tuple[Op, tuple[Rows, ...], slice], ...]

    @staticmethod
    def of(graph: Graph, wanted: Sequence[int]) -> "Layout":
        """The layout for some nodes of a graph."""
        level: dict[int, int] = {}
        groups: dict[tuple[object, ...], list[int]] = {}
        for node in graph.below(wanted):
            op = graph.ops[node]
            level[node] = max((1 + level[arg] for arg in op.args), default=0)
            groups.setdefault((level[node], op.name, len(op.args)), []).append(node)
        order = sorted(groups.values(), key=lambda group: (level[group[0]], group[0]))
        row = {node: i for i, node in enumerate(node for group in order for node in group)}
        signals, constants, alike = [], [], []
        for group in order:
            op = graph.ops[group[0]]
            if op.name == "signal":
                signals += [(_key(graph.ops[node]), row[node]) for node in group]
            elif op.name == "constant":
                constants += [(row[node], graph.constant(node)) for node in group]
            else:
                args = zip(*(graph.ops[node].args for node in group), strict=True)
                rows = tuple(_rows([row[arg] for arg in part]) for part in args)
                alike.append((op, rows, slice(row[group[0]], row[group[0]] + len(group))))
        ready = plan(graph, dict.fromkeys(wanted, (0, 1)), 1)
        return Layout(ready, row, tuple(signals), tuple(constants), tuple(alike))


def _key(op: Op) -> tuple[str, int | None]:
    name, part = op.data
    return str(name), part if isinstance(part, int) else None


def _rows(rows: list[int]) -> Rows:
    """The rows as a slice, if they are evenly spaced, else as an array."""
    if len(set(rows)) == 1:
        return slice(rows[0], rows[0] + 1)  # the same for all
    step = rows[1] - rows[0]
    if step > 0 and rows == list(range(rows[0], rows[-1] + 1, step)):
        return slice(rows[0], rows[-1] + 1, step)
    return np.array(rows, np.intp)


class Sheet:
    """The values of nodes at one sample of `count` trajectories; every operation knows its arrays."""

    def __init__(self, layout: Layout, count: int) -> None:
        self._layout = layout
        self._values = np.empty((len(layout.rows), count))
        for row, value in layout.constants:
            self._values[row] = value
        self._signals = [(key, self._values[row]) for key, row in layout.signals]
        self._operations = [one for op, args, out in layout.alike for one in self._bound(op, args, self._values[out])]

    def read(self, signals: Signals) -> Array:
        """The values at one sample, (rows, N), from its signals, (N, 1) each. The next call overwrites them.

        Raises:
          FloatingPointError: where an expression has no finite value.
        """
        for key, row in self._signals:
            row[:] = signals[key][:, 0]
        try:
            with np.errstate(all="raise"):
                for operation in self._operations:
                    operation()
        except FloatingPointError:  # also where a number is too small for a float, which is no mistake
            for node, values in self._layout.plan.run(signals).items():
                self._values[self._layout.rows[node]] = values[:, 0]
        return self._values

    def _bound(self, op: Op, rows: tuple[Rows, ...], out: Array) -> Iterator[Callable[[], object]]:
        args = []
        for own in rows:
            if isinstance(own, slice):
                args.append(self._values[own])
            else:
                args.append(np.empty((len(own), out.shape[1])))
                yield partial(self._values.take, own, 0, args[-1], "clip")
        if op.name in UFUNCS:
            ufunc = UFUNCS[op.name]
            yield partial(ufunc, *args[:2], out=out)
            for arg in args[2:]:
                yield partial(ufunc, out, arg, out=out)
        elif op.name in {"norm", "squares"}:
            square = np.empty_like(out)
            yield partial(np.multiply, args[0], args[0], out=out)
            for arg in args[1:]:
                yield partial(np.multiply, arg, arg, out=square)
                yield partial(np.add, out, square, out=out)
            if op.name == "norm":
                yield partial(np.sqrt, out, out=out)
        else:
            yield partial(apply, op, args, out)
