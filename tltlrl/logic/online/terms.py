"""Formulas as an automaton reads them: negations at the predicates, and nothing bounded that is counted from the
first sample.

A bound that is counted from the first sample needs no counter: `G[a,b] p` at the root is `G (clock => p)`, where the
clock of [a, b] is +inf at the steps a .. b and -inf at all others. Terms are nodes of a graph of their own:

| name | parameters | value on the slice [t, e) |
|---|---|---|
| literal | node of the spec's graph, sign | that node's value at t, negated when the sign is False |
| clock | a, b, inside | +inf if a <= t <= b, else -inf; the other way round when not inside |
| minimum, maximum, next, always, eventually | as in tltlrl.logic.graph | |
| until, release | | p U q, p R q; p is a literal |
| chop | obligations, a, b | max over t' in t + [a, b] of min(q on [t', e), obligations on [t, t')) |
| refuse | | minus the value of its argument, a chop |
| bounded | | its argument, which looks only so far ahead; read when that is past, like a literal |

p U q is `chop(G p, q)` and p T q is `chop(F p, q)`, whatever operators p holds. An obligation is a formula for the next
sample; `strong` ones also demand that there is one.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from tltlrl.logic.graph import FOREVER, Graph, Op

Obligation = tuple[bool, int]  # strong, term
Obligations = frozenset[Obligation]

_DUAL = {"always": "eventually", "eventually": "always", "minimum": "maximum", "maximum": "minimum"}


class UnsupportedError(Exception):
    """An operation of the spec's graph that no term says."""


@dataclass(slots=True)
class Terms:
    """The terms of one spec, each stored once.

    Attributes:
      source: the spec's graph.
      graph: the terms.
    """

    source: Graph
    graph: Graph = field(default_factory=Graph)
    _made: dict[tuple[int, bool, bool], int] = field(default_factory=dict)
    _negated: dict[int, int] = field(default_factory=dict)
    _horizons: dict[int, int | None] = field(default_factory=dict)
    _bracketed: dict[int, int] = field(default_factory=dict)

    def of(self, node: int, positive: bool = True, crisp: bool = False) -> int:
        """The term of a node of the spec's graph, or of its negation; `crisp`: of `holds` of it, moved to its literals.

        Raises:
          UnsupportedError: if there is none.
        """
        key = node, positive, crisp
        if key not in self._made:
            self._made[key] = self._term(self.source.ops[node], node, positive, crisp)
        return self._made[key]

    def _term(self, op: Op, node: int, positive: bool, crisp: bool) -> int:
        add = self.graph.add
        if op.name == "negative":
            return self.of(op.args[0], not positive, crisp)
        if self.source.local[node]:
            return add("literal", data=(self.source.add("holds", node) if crisp else node, positive))
        match op.name, op.data:
            case "holds", _:
                return self.of(op.args[0], positive, True)
            case "ends", (int(steps),):
                return self.later(self.clock(0, FOREVER, not positive), steps, not positive)
            case ((("minimum" | "maximum" | "always" | "eventually") as name), data):
                parts = [self.of(arg, positive, crisp) for arg in op.args]
                return add(name if positive else _DUAL[name], *parts, data=data)
            case "next", (int(steps), bool(strong)):
                return self.later(self.of(op.args[0], positive, crisp), steps, strong == positive)
            case ((("until" | "then") as name), (window, _)):
                p, q = op.args
                return self._until(name, p, q, window, positive, crisp)
        raise UnsupportedError(op.name)

    def later(self, term: int, steps: int, strong: bool) -> int:
        """X^steps of a term."""
        return self.graph.add("next", term, data=(steps, strong)) if steps else term

    def _until(self, name: str, p: int, q: int, window: object, positive: bool, crisp: bool) -> int:
        """p U q or p T q, or its negation."""
        add = self.graph.add
        if window is None and self.source.local[p]:
            first, second = self.of(p, positive, crisp), self.of(q, positive, crisp)
            if name == "until":
                return add("until" if positive else "release", first, second)
            # The largest p before t' is reached at some t'' < t'.
            both, some = ("minimum", "eventually") if positive else ("maximum", "always")
            later = self.later(add(some, second, data=(None,)), 1, positive)
            return add(some, add(both, first, later), data=(None,))
        low, high = window if isinstance(window, tuple) else (0, FOREVER)
        held = add("always" if name == "until" else "eventually", self.of(p, True, crisp), data=(None,))
        chop = self.chop(frozenset({(name == "then", held)}), self.of(q, True, crisp), low, high)
        return chop if positive else self.negation(chop)

    def chop(self, left: Obligations, right: int, low: int, high: int) -> int:
        """First the obligations, then `right`, from a step in [low, high] on."""
        return self.graph.add("chop", right, data=(left, low, high))

    def clock(self, low: int, high: int, inside: bool = True) -> int:
        """The clock of the steps low .. high."""
        return self.graph.add("clock", data=(low, high, inside))

    def from_start(self, node: int, positive: bool = True, at: int = 0, crisp: bool = False) -> int:
        """The term of a node that is read at step `at` of the trajectory and at no other; it is read at step 0."""
        op, add = self.source.ops[node], self.graph.add
        from_here = (at, FOREVER)
        if op.name == "negative":
            return self.from_start(op.args[0], not positive, at, crisp)
        if self.source.local[node]:
            return (
                self._within("always", self.of(node, positive, crisp), (at, at))
                if at
                else self.of(node, positive, crisp)
            )
        match op.name, op.data:
            case "holds", _:
                return self.from_start(op.args[0], positive, at, True)
            case "ends", (int(steps),):
                step = self.clock(at + steps, at + steps, not positive)
                return add("always" if positive else "eventually", step, data=(None,))
            case ((("minimum" | "maximum") as name), _):
                parts = [self.from_start(arg, positive, at, crisp) for arg in op.args]
                return add(name if positive else _DUAL[name], *parts)
            case ((("always" | "eventually") as name), (window,)):
                low, high = window if isinstance(window, tuple) else (0, FOREVER)
                own = name if positive else _DUAL[name]
                reach = (at + low, at + high if high < FOREVER else FOREVER)
                return self._within(own, self.of(op.args[0], positive, crisp), reach)
            case "next", (int(steps), bool(strong)):
                there = self.from_start(op.args[0], positive, at + steps, crisp)
                if strong == positive:  # the step exists, and ...
                    return add("minimum", add("eventually", self.clock(at + steps, at + steps), data=(None,)), there)
                never = add("always", self.clock(at + steps, at + steps, False), data=(None,))
                return add("maximum", never, there)
            case ((("until" | "then") as name), (window, truncated)) if at or window is not None:
                if window is None and name == "until" and not truncated:
                    p, q = (self.of(arg, positive, crisp) for arg in op.args)
                    kinds = ("until", True, False) if positive else ("release", False, True)
                    return add(kinds[0], self._if(from_here, p, kinds[1]), self._if(from_here, q, kinds[2]))
                low, high = window if isinstance(window, tuple) else (0, FOREVER)
                held = self._within(
                    "always" if name == "until" else "eventually", self.of(op.args[0], True, crisp), from_here
                )
                witness = self._if(
                    (at + low, at + high if high < FOREVER else FOREVER), self.of(op.args[1], True, crisp), False
                )
                chop = self.chop(frozenset({(name == "then", held)}), witness, 0, FOREVER)
                return chop if positive else self.negation(chop)
        return self.of(node, positive, crisp)

    def _if(self, steps: tuple[int, int], term: int, otherwise: bool) -> int:
        """The term at these steps, at all others +inf if `otherwise`, else -inf."""
        if steps == (0, FOREVER):
            return term
        if otherwise:
            return self.graph.add("maximum", self.clock(*steps, False), term)
        return self.graph.add("minimum", self.clock(*steps), term)

    def _within(self, name: str, term: int, steps: tuple[int, int]) -> int:
        return self.graph.add(name, self._if(steps, term, name == "always"), data=(None,))

    def conjuncts(self, term: int) -> list[int]:
        """The terms whose minimum it is."""
        op = self.graph.ops[term]
        if op.name != "minimum":
            return [term]
        return list(dict.fromkeys(part for arg in op.args for part in self.conjuncts(arg)))

    def negation(self, term: int) -> int:
        """The term of its negation."""
        if term not in self._negated:
            negated = self._negation(term)
            self._negated[term], self._negated[negated] = negated, term
        return self._negated[term]

    def _negation(self, term: int) -> int:
        op, add = self.graph.ops[term], self.graph.add
        match op.name, op.data:
            case ("literal", (node, bool(sign))):
                return add("literal", data=(node, not sign))
            case "clock", (low, high, bool(inside)):
                return add("clock", data=(low, high, not inside))
            case "next", (steps, bool(strong)):
                return add("next", self.negation(op.args[0]), data=(steps, not strong))
            case "chop", _:
                return add("refuse", term)
            case "refuse", _:
                return op.args[0]
            case "until", _:
                return add("release", *map(self.negation, op.args))
            case "release", _:
                return add("until", *map(self.negation, op.args))
            case "bounded", data:
                return add("bounded", self.negation(op.args[0]), data=data)
            case name, data:
                return add(_DUAL[name], *map(self.negation, op.args), data=data)
        raise AssertionError(op)

    def below(self, roots: Iterable[int]) -> set[int]:
        """All terms that these are made of, themselves included."""
        found, stack = set[int](), list(roots)
        while stack:
            term = stack.pop()
            if term not in found:
                found.add(term)
                op = self.graph.ops[term]
                stack.extend(op.args)
                if op.name == "chop":
                    left, *_ = op.data
                    assert isinstance(left, frozenset)
                    stack.extend(part for _, part in left)
        return found

    # How far ahead

    def horizon(self, term: int) -> int | None:
        """How many steps beyond t the value at t depends on; None when on all that follow."""
        if term not in self._horizons:
            self._horizons[term] = self._horizon(self.graph.ops[term])
        return self._horizons[term]

    def _horizon(self, op: Op) -> int | None:
        own = 0
        match op.name, op.data:
            case (("literal" | "clock"), _):
                return 0
            case "next", (int(steps), _):
                own = steps
            case (("always" | "eventually"), ((_, int(high)),)):
                own = high
            case (("minimum" | "maximum" | "bounded"), _):
                pass
            case _:
                return None
        parts = [self.horizon(arg) for arg in op.args]
        return None if None in parts else own + max(part for part in parts if part is not None)

    def with_bounded(self, term: int) -> int:
        """The term with its largest bounded parts put in brackets, but those before a chop."""
        if term not in self._bracketed:
            op, horizon = self.graph.ops[term], self.horizon(term)
            if op.name == "refuse" or horizon == 0:
                self._bracketed[term] = term
            elif horizon is not None:
                self._bracketed[term] = self.graph.add("bounded", term, data=(horizon,))
            else:
                self._bracketed[term] = self.graph.add(op.name, *map(self.with_bounded, op.args), data=op.data)
        return self._bracketed[term]

    # Which implies which

    def implies(self, strong: int, weak: int) -> bool:
        """Whether the first is known to be at most the second, on every slice."""
        if strong == weak:
            return True
        a, b = self._reach(strong), self._reach(weak)
        if a is None or b is None or a[0] != b[0] or a[3] != b[3]:
            return False
        inner, outer = (a, b) if a[0] == "eventually" else (b, a)
        return outer[1] <= inner[1] and inner[2] <= outer[2]

    def _reach(self, term: int) -> tuple[str, int, int, int] | None:
        """`F[a,b] p`, `G[a,b] p`, and the same k steps later, as (name, a, b, p)."""
        op, later = self.graph.ops[term], 0
        if op.name == "next":
            inner = self.graph.ops[op.args[0]]
            if (inner.name, op.data[1]) not in {("eventually", True), ("always", False)}:
                return None
            steps, _ = op.data
            assert isinstance(steps, int)
            op, later = inner, steps
        if op.name not in {"always", "eventually"}:
            return None
        (window,) = op.data
        low, high = window if isinstance(window, tuple) else (0, FOREVER - later)
        return op.name, low + later, high + later, op.args[0]
