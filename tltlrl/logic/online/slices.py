"""The values of terms on a slice of the last samples, by the definition; how the slice goes on may be unknown."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tltlrl.logic import scans
from tltlrl.logic.graph import Array, Op
from tltlrl.logic.online.terms import Obligations, Terms


@dataclass(frozen=True, slots=True)
class Ahead:
    """What is supposed of the samples behind a slice, of which there may be any number.

    Attributes:
      best: whether all literals are +inf there, or -inf.
      never, forever: clocks that are -inf there, and +inf.
    """

    best: bool
    never: frozenset[int] = frozenset()
    forever: frozenset[int] = frozenset()

    def opposite(self) -> "Ahead":
        """The worst in place of the best, and the other way round."""
        return replace(self, best=not self.best)


@dataclass(slots=True)
class Slice:
    """Values of terms on [0, T) of a slice: exact, or an upper or a lower bound.

    Attributes:
      terms: that are read.
      literals: literal or clock => its values, (N, T).
      ahead: None for trajectories that end with the slice.
    """

    terms: Terms
    literals: Mapping[int, Array]
    ahead: Ahead | None
    _values: dict[int, Array] = field(default_factory=dict)

    def all_of(self, obligations: Obligations) -> Array:
        """The minimum of some terms, (N, T)."""
        values = np.full(next(iter(self.literals.values())).shape, np.inf)
        for _, term in obligations:
            np.minimum(values, self.of(term), out=values)
        return values

    def of(self, term: int) -> Array:
        """The values of a term at each sample, (N, T)."""
        if term not in self._values:
            op = self.terms.graph.ops[term]
            self._values[term] = self.literals[term] if op.name in {"literal", "clock"} else self._of(op)
        return self._values[term]

    def _of(self, op: Op) -> Array:
        match op.name, op.data:
            case "bounded", _:
                return self.of(op.args[0])
            case "refuse", _:
                return -Slice(self.terms, self.literals, self.ahead and self.ahead.opposite()).of(op.args[0])
            case "chop", (frozenset() as left, int(low), int(high)):
                return self._chop(left, self.of(op.args[0]), low, high, self._behind(op, -np.inf))
            case "minimum", _:
                return np.minimum.reduce([self.of(arg) for arg in op.args])
            case "maximum", _:
                return np.maximum.reduce([self.of(arg) for arg in op.args])
            case "next", (int(steps), bool(strong)):
                x = self.of(op.args[0])
                out = np.full_like(x, self._behind(op, -np.inf if strong else np.inf))
                out[:, : max(x.shape[1] - steps, 0)] = x[:, steps:]
                return out
            case "always", (window,):
                return _extreme(np.minimum, self.of(op.args[0]), self._behind(op, np.inf), window)
            case "eventually", (window,):
                return _extreme(np.maximum, self.of(op.args[0]), self._behind(op, -np.inf), window)
            case "until", _:
                p, q = map(self.of, op.args)
                return _until(p, q, self._behind(op, -np.inf))
            case "release", _:
                p, q = map(self.of, op.args)
                return -_until(-p, -q, -self._behind(op, np.inf))
        raise AssertionError(op)

    def _behind(self, op: Op, at_end: float) -> float:
        """What the operator is worth behind the slice."""
        return at_end if self.ahead is None else self._with_more(op, at_end, self.ahead)

    def _with_more(self, op: Op, at_end: float, ahead: Ahead) -> float:
        """The better (or worse) of the two: its value if no sample follows, that of its last argument if some do."""
        return (max if ahead.best else min)(at_end, self._supposed(op.args[-1], ahead))

    def _supposed(self, term: int, ahead: Ahead) -> float:
        """The value of a term behind the slice, if there is a sample."""
        op = self.terms.graph.ops[term]
        match op.name, op.data:
            case (("literal" | "clock"), _):
                best = term not in ahead.never if ahead.best else term in ahead.forever
                return np.inf if best else -np.inf
            case "bounded", _:
                return self._supposed(op.args[0], ahead)
            case "refuse", _:
                return -self._supposed(op.args[0], ahead.opposite())
            case "minimum", _:
                return min(self._supposed(arg, ahead) for arg in op.args)
            case "maximum", _:
                return max(self._supposed(arg, ahead) for arg in op.args)
            case "next", (_, bool(strong)):
                return self._with_more(op, -np.inf if strong else np.inf, ahead)
            case (("always" | "release"), _):
                return self._with_more(op, np.inf, ahead)
            case _:
                return self._with_more(op, -np.inf, ahead)

    def _chop(self, left: Obligations, right: Array, low: int, high: int, behind: float) -> Array:
        """Each place where the left slice may end is tried; of places behind the slice, only `behind` is known."""
        steps = right.shape[1]
        out = np.full_like(right, behind)
        for stop in range(low, steps):
            first = max(0, stop - high)
            held = np.full((len(right), stop - low + 1 - first), np.inf)
            cut = {term: values[:, first:stop] for term, values in self.literals.items()}
            if stop > first:
                whole = Slice(self.terms, cut, None).all_of(left)
                reach = min(whole.shape[1], held.shape[1])
                held[:, :reach] = whole[:, :reach]
            if low == 0 and any(strong for strong, _ in left):
                held[:, -1] = -np.inf
            part = out[:, first : first + held.shape[1]]
            np.maximum(part, np.minimum(held, right[:, stop, None]), out=part)
        return out


def _extreme(fold: scans.Fold, x: Array, behind: float, window: object) -> Array:
    """G or F: the extreme of what is in the window, and `behind` for what of it sticks out."""
    steps = x.shape[1]
    if not isinstance(window, tuple):
        return scans.suffixes(fold, scans.padded(x, steps + 1, behind))[:, :steps]
    low, high = min(window[0], steps), min(window[1], steps)  # everything further on has the same value
    return scans.windows(fold, scans.padded(x, steps + high, behind)[:, low:], high - low + 1)[:, :steps]


def _until(p: Array, q: Array, behind: float) -> Array:
    """p U q, which is worth `behind` behind the slice."""
    return scans.until(p, scans.padded(q, q.shape[1] + 1, behind))[:, :-1]
