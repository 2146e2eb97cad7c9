"""What a spec means, as a flat graph of scalar operations, each of which is computed once per trajectory.

A vector becomes one node per component. Names are gone; equal sub-formulas share one node. The arguments of a node come
before it, so no pass over the graph needs recursion.
"""

import math
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# op => the function of its arguments' arrays. n-ary minimum and maximum fold from the left.
UFUNCS: dict[str, np.ufunc] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "power": np.power,
    "negative": np.negative,
    "absolute": np.absolute,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan2": np.arctan2,
    "log": np.log,
    "mod": np.mod,
    "sign": np.sign,
    "floor": np.floor,
    "minimum": np.minimum,
    "maximum": np.maximum,
}
ARITHMETIC = {*UFUNCS, "norm", "squares", "wrap", "holds"}
POINTWISE = {*ARITHMETIC, "signal", "constant"}
# Operations that are undefined or not finite for some finite arguments. They are computed at every sample, so that
# no mistake is missed.
PARTIAL = {"divide", "power", "sqrt", "exp", "log", "asin", "acos", "mod"}
# Operations whose values are infinite only where an argument is (of formulas: true and false).
SELECTING = {"minimum", "maximum", "negative", "holds"}
# Operations that look back as far as the first sample of the trajectory, whatever slice they are read on.
PAST = {"lag", "previous", "once", "historically", "since"}
BEGUN = ("", None)  # key of the signal that is +inf from a trajectory's first sample on, and -inf before

# Sums of squares below _TINY may have lost digits; those of components times _SCALE have not.
_TINY, _SCALE = 2.0**-960, 2.0**600

Window = tuple[int, int] | None
FOREVER = 2**62  # the upper bound of a window without end, where a lower one has to be named


@dataclass(frozen=True, slots=True)
class Op:
    """One node: an operation, the numbers of its arguments, and its parameters.

    | name | parameters | value at t |
    |---|---|---|
    | signal | signal's name, component or None | the sample |
    | constant | number | the number |
    | any of UFUNCS | | that function of the arguments at t |
    | norm, squares | | root of the sum of squares, the sum |
    | wrap | | the angle in (-pi, pi] that differs from the argument by whole turns |
    | holds | | +inf, -inf, 0 by the sign of the argument |
    | ends | steps k | +inf where t + k lies beyond the end, else -inf |
    | next | steps k, strong | argument at t + k; beyond the end -inf when strong, else +inf |
    | lag | | argument at t - 1; at the first sample that of the first sample |
    | previous | steps k, strong | argument at t - k; before the start -inf when strong, else +inf |
    | once, historically | window or None | max, min over t - window, None meaning from the start |
    | since | | max over t' <= t of the least of the second at t' and the first at t' + 1 .. t |
    | always, eventually | window or None | min, max over the window, None meaning to the end |
    | second | | second smallest value of the argument over time (tltlrl.logic.shortcut) |
    | until, then | window or None, truncated | the definition; `truncated`: the left operand is temporal |
    """

    name: str
    args: tuple[int, ...] = ()
    data: tuple[object, ...] = ()


@dataclass(slots=True)
class Graph:
    """Operations in an order in which arguments come first; an equal operation is never stored twice."""

    ops: list[Op] = field(default_factory=list)
    # Whether the value at t is the same on all slices that hold t.
    local: list[bool] = field(default_factory=list)
    looks_back: list[bool] = field(default_factory=list)  # whether there is an operator of the past in it
    # A bounded until that was split into other operations: its node -> its right operand and its upper bound.
    split: dict[int, tuple[int, int]] = field(default_factory=dict)
    # A bounded since that was split into other operations: its node -> its operands and its upper bound.
    split_past: dict[int, tuple[int, int, int]] = field(default_factory=dict)
    _number: dict[Op, int] = field(default_factory=dict)

    def add(self, name: str, *args: int, data: tuple[object, ...] = ()) -> int:
        """Adds an operation, unless an equal one is there, and returns its number. Constants are folded.

        Raises:
          FloatingPointError: if an operation on constants has no finite value.
        """
        if name == "negative" and self.ops[args[0]].name == "negative":
            return self.ops[args[0]].args[0]
        if name in {"minimum", "maximum"} and len(args) == 1:
            return args[0]
        op = Op(name, args, data)
        if args and name in POINTWISE and all(self.ops[a].name == "constant" for a in args):
            with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
                value = float(apply(op, [np.asarray(self.constant(a)) for a in args]))
            op = Op("constant", data=(value,))
        if op not in self._number:
            self._number[op] = len(self.ops)
            self.ops.append(op)
            self.local.append(name in POINTWISE | PAST and all(self.local[a] for a in args))
            self.looks_back.append(name in PAST or any(self.looks_back[a] for a in args))
        return self._number[op]

    def constant(self, number: int) -> float:
        """The value of a constant node."""
        (value,) = self.ops[number].data
        assert isinstance(value, float)
        return value

    def below(self, roots: Iterable[int], without: Container[int] = ()) -> list[int]:
        """Every node that the roots depend on, and the roots, arguments first; it does not look below `without`."""
        seen: set[int] = set()
        stack = list(roots)
        while stack:
            node = stack.pop()
            if node not in seen and node not in without:
                seen.add(node)
                stack.extend(self.ops[node].args)
        return sorted(seen)

    def horizon(self, root: int) -> int | None:
        """How many steps after t the value at t can depend on; None if on all."""
        reach: dict[int, float] = {}  # below zero: only on earlier ones
        for node in self.below([root]):
            op = self.ops[node]
            deepest = max((reach[a] for a in op.args), default=0.0)
            match op.name, op.data:
                case ("next", (int(steps), _)) | ("ends", (int(steps),)):
                    deepest += steps
                case "lag", _:
                    deepest -= 1
                case "previous", (int(steps), _):
                    deepest -= steps
                case (("once" | "historically"), ((int(lower), _),)):
                    deepest -= lower
                case (("always" | "eventually"), (None,)):
                    deepest = math.inf
                case (("until" | "then"), (None, _)):
                    deepest = math.inf
                case (("always" | "eventually"), ((_, int(upper)),)):
                    deepest += upper
                case (("until" | "then"), ((_, int(upper)), _)):
                    # The left operand is read on slices that end at t + upper, whatever it reaches itself.
                    deepest = reach[op.args[1]] + upper
            if node in self.split:
                right, upper = self.split[node]
                deepest = min(deepest, reach[right] + upper)
            reach[node] = deepest if deepest < FOREVER else math.inf
        return None if reach[root] == math.inf else max(0, int(reach[root]))

    def memory(self, root: int) -> int | None:
        """How many steps before t the value at t can depend on; None if on all."""
        depth: dict[int, float] = {}
        for node in self.below([root]):
            op = self.ops[node]
            deepest = max((depth[a] for a in op.args), default=0.0)
            match op.name, op.data:
                case "lag", _:
                    deepest += 1
                case "previous", (int(steps), _):
                    deepest += steps
                case (("once" | "historically"), ((_, int(upper)),)):
                    deepest += upper
                case (("once" | "historically"), (None,)) | ("since", _):
                    deepest = math.inf
                case "next", (int(steps), _):
                    deepest -= steps
                case (("always" | "eventually"), ((int(lower), _),)):
                    deepest -= lower
            if node in self.split_past:
                left, right, upper = self.split_past[node]
                deepest = min(deepest, max(depth[right] + upper, depth[left] + upper - 1))
            depth[node] = max(0.0, deepest)
        return None if depth[root] == math.inf else int(depth[root])


def _wrapped(x: Array) -> Array:
    """The angle in (-pi, pi] that differs from x by whole turns; x itself where it lies there."""
    wrapped: Array = x - 2 * np.pi * np.ceil((x - np.pi) / (2 * np.pi))
    return wrapped


def _by_sign(x: Array) -> Array:
    """+inf, -inf or 0, as x is above, below or at zero."""
    return np.where(x == 0, 0.0, np.copysign(np.inf, x))


_OTHERS: dict[str, Callable[[Array], Array]] = {"wrap": _wrapped, "holds": _by_sign}


def apply(op: Op, args: list[Array], out: Array | None = None, scratch: Array | None = None) -> Array:
    """A pointwise operation on its arguments' values, into `out` if given; norm and squares also write to `scratch`."""
    value: Array
    if op.name == "squares":
        return _squares(args, out, scratch)
    if op.name == "norm":
        try:
            with np.errstate(under="raise"):
                return np.sqrt(_squares(args, out, scratch), out=out)
        except FloatingPointError as error:
            if "underflow" not in str(error):
                raise
            return _norm_of_small(args, out)
    if op.name in _OTHERS:
        value = _OTHERS[op.name](args[0])
        if out is None:
            return value
        out[...] = value
        return out
    ufunc = UFUNCS[op.name]
    value = ufunc(*args[:2], out=out)
    for arg in args[2:]:
        value = ufunc(value, arg, out=out)
    return value


def _squares(args: list[Array], out: Array | None, scratch: Array | None) -> Array:
    value = np.multiply(args[0], args[0], out=out)
    for arg in args[1:]:
        value = np.add(value, np.multiply(arg, arg, out=scratch), out=out)
    return value


def _norm_of_small(args: list[Array], out: Array | None) -> Array:
    """The norm of numbers whose squares would vanish: they are scaled by a power of 2, which changes no digit."""
    with np.errstate(under="ignore", over="ignore"):
        plain = sum(arg * arg for arg in args)
        scaled = sum((arg * _SCALE) ** 2 for arg in args)
    value: Array = np.where(plain < _TINY, np.sqrt(scaled) / _SCALE, np.sqrt(plain))
    if out is None:
        return value
    out[...] = value
    return out
