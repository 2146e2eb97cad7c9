"""Traps of finite trajectories: formulas that are well-formed but do not say what most writers mean.

The section Traps of docs/spec-language.md has one line for each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tltlrl.logic import syntax
from tltlrl.logic.graph import Array
from tltlrl.logic.syntax import Node

UNEQUAL = 10.0  # largest ratio of two predicates' largest margins


@dataclass(frozen=True, slots=True)
class Trap:
    """A trap: something that a formula says and that is easily missed.

    Attributes:
      line, column: its place in the text.
      text: what the formula says, and what to write if something else is meant.
    """

    line: int
    column: int
    text: str


@dataclass(frozen=True, slots=True)
class _Place:
    """How a sub-formula is read.

    Attributes:
      positive: whether no or an even number of negations stands around it.
      at_all: whether it, or its negation if not positive, has to hold at every sample up to the last.
      at_some: whether at one of these.
    """

    positive: bool = True
    at_all: bool = False
    at_some: bool = False

    def negated(self) -> _Place:
        return replace(self, positive=not self.positive)

    def always(self) -> _Place:
        """Of what must hold, as written, at every sample."""
        return replace(self, **{"at_all" if self.positive else "at_some": True})

    def eventually(self) -> _Place:
        """Of what must hold, as written, at some sample."""
        return replace(self, **{"at_some" if self.positive else "at_all": True})


def traps(document: syntax.Document) -> tuple[Trap, ...]:
    """The traps in a spec, in the order of its text."""
    definitions = {d.name: d.body for d in document.declarations if isinstance(d, syntax.Definition)}
    found: dict[tuple[int, int, str], None] = {}
    seen: set[tuple[int, _Place]] = set()
    stack = [(document.formula, _Place())]
    while stack:
        node, place = stack.pop()
        if (id(node), place) in seen:
            continue
        seen.add((id(node), place))
        for text in _told(node, place):
            found[node.span.line, node.span.column, text] = None
        if isinstance(node, syntax.And) and place == _Place():
            for part, text in _of_conjunction(node):
                found[part.span.line, part.span.column, text] = None
        stack.extend(_parts(node, place))
        if isinstance(node, syntax.Index):
            node = node.base
        if isinstance(node, syntax.Name | syntax.Call):
            name = node.name if isinstance(node, syntax.Name) else node.function
            if name in definitions:
                stack.append((definitions[name], place))
    return tuple(Trap(*key) for key in sorted(found))


def _parts(node: Node, place: _Place) -> Iterator[tuple[Node, _Place]]:
    """The sub-formulas of a formula, and how each is read."""
    match node:
        case syntax.Not(p):
            yield p, place.negated()
        case syntax.Implies(p, q):
            yield p, place.negated()
            yield q, place
        case syntax.Iff(p, q) | syntax.Xor(p, q):
            for part in (p, q):
                yield part, place
                yield part, place.negated()
        case syntax.Always(p, None):
            yield p, place.always()
        case syntax.Eventually(p, None):
            yield p, place.eventually()
        case syntax.Until(p, q, None) | syntax.Then(p, q, None):
            yield p, place  # read on a slice of its own, whose end q decides
            yield q, place.eventually()
        case syntax.WeakUntil(p, q, None):
            yield p, place
            yield q, place.eventually()
        case syntax.Release(p, q, None):
            yield p, place
            yield q, place.always()
        case syntax.Comparison() | syntax.Interval():
            return
        case syntax.Call(name, arguments):
            yield from ((a, place) for a in arguments)
            if name in {"rise", "fall", "holds"}:
                yield from ((a, place.negated()) for a in arguments if name != "holds")
        case _:
            yield from ((child, place) for child in syntax.children(node))


def _told(node: Node, place: _Place) -> Iterator[str]:
    """What is to be said of one formula, where it stands."""
    strong_here = place.at_all if place.positive else place.at_some  # a window that fails when cut, at each sample
    weak_here = place.at_some if place.positive else place.at_all  # a window that holds when cut, at some sample
    match node:
        case syntax.Always(syntax.Eventually(p, None), None) | syntax.Eventually(syntax.Always(p, None), None):
            yield (
                f"{_short(node)} is {_short(p)} at the last sample: nothing is asked of the others; to ask for n+1 "
                "samples write F G[0,n!] p, for once in any n+1 samples G F[0,n?] p"
            )
        case syntax.Eventually(_, syntax.Interval(a, b, "")) if strong_here and not isinstance(b, syntax.Infinity):
            yield _cut(node, "not met", f"F[{a}, {b}?]", "met")
        case syntax.Until(_, _, syntax.Interval(a, b, "")) if strong_here and not isinstance(b, syntax.Infinity):
            yield _cut(node, "not met", f"U[{a}, {b}?]", "met")
        case syntax.Always(_, syntax.Interval(a, b, "")) if weak_here and not isinstance(b, syntax.Infinity):
            yield _cut(node, "met", f"G[{a}, {b}!]", "not met")
        case syntax.Release(_, _, syntax.Interval(a, b, "")) if weak_here and not isinstance(b, syntax.Infinity):
            yield _cut(node, "met", f"R[{a}, {b}!]", "not met")
        case syntax.Next(_, False) if weak_here:
            yield f"{_short(node)} holds at the last sample, whatever is asked; write X[!] if a next one must exist"
        case syntax.Next(_, True) if strong_here:
            yield f"{_short(node)} fails at the last sample, whatever is asked; write X if there may be no next sample"
        case syntax.Next(_, False) if not (place.at_all or place.at_some):
            yield (
                f"on a trajectory that ends there, {_short(node)} holds with the value +inf; write X[!] if the next "
                "sample must exist"
            )
    match node:
        case syntax.Always(syntax.Implies(p, syntax.Next(syntax.Always(syntax.Not(q), None), _)), None) if p == q:
            yield (
                f"{_short(p)} may hold at one sample only, so that the robustness is at most half of its largest "
                "change from one sample to the next"
            )


def _of_conjunction(conjunction: syntax.And) -> Iterator[tuple[Node, str]]:
    """What is to be said of an operand of a conjunction beside the others: of `F p & G (p => X q)`, its second."""
    operands = conjunction.operands
    met = [_conjuncts(part.operand) for part in operands if isinstance(part, syntax.Eventually) and not part.interval]
    for part in operands:
        match part:
            case syntax.Always(syntax.Implies(p, syntax.Next(_, False) as after), None) if _conjuncts(p) in met:
                with_p = [found for found in met if all(each in found for each in _conjuncts(p))]
                if not any(isinstance(each, syntax.Next) and each.strong for found in with_p for each in found):
                    yield (
                        part,
                        f"{_short(p)} may hold at the last sample alone, and then nothing is asked of what follows; "
                        f"if it must follow, add F ({syntax.And((p, _strong(after)))})",
                    )


def _conjuncts(formula: Node) -> list[Node]:
    return (
        [each for part in formula.operands for each in _conjuncts(part)]
        if isinstance(formula, syntax.And)
        else [formula]
    )


def _strong(formula: Node) -> Node:
    """A formula whose X at the front, one or several, ask for next samples."""
    return syntax.Next(_strong(formula.operand), strong=True) if isinstance(formula, syntax.Next) else formula


def _cut(node: Node, now: str, written: str, then: str) -> str:
    return (
        f"near the end of the trajectory the window of {_short(node)} is cut, and what would come after the end counts "
        f"as {now}; write {written} if it is to count as {then}"
    )


def _short(node: Node) -> str:
    text = str(node)
    text = text if len(text) <= 40 else text[:37] + "..."
    return f"'{text}'"


def unequal_scales(margins: Mapping[str, Array]) -> str | None:
    """A warning if one predicate's margins are so much smaller that it decides alone; otherwise None.

    Args:
      margins: each predicate => its margins along one trajectory, (T,).
    """
    largest = {text: float(np.max(np.abs(values))) for text, values in margins.items()}
    largest = {text: value for text, value in largest.items() if 0 < value < np.inf}
    if len(largest) < 2:
        return None
    small, great = min(largest, key=largest.__getitem__), max(largest, key=largest.__getitem__)
    if largest[great] <= UNEQUAL * largest[small]:
        return None
    return (
        f"the margins of '{great}' reach {largest[great]:.3g} here, those of '{small}' {largest[small]:.3g}: min and "
        "max compare them, so that one may decide alone; bring them to one scale"
    )
