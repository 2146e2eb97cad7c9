"""What a spec means: its formula with every name resolved, over one graph of numbers."""

from collections.abc import Mapping
from dataclasses import dataclass

from tltlrl.logic import syntax
from tltlrl.logic.declarations import Value
from tltlrl.logic.errors import Span
from tltlrl.logic.graph import Graph


@dataclass(frozen=True, slots=True)
class Predicate:
    """A predicate, or an expression that can have no finite value: its text and its place."""

    text: str
    span: Span


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A formula as it was written: an operation (see tltlrl.logic.graph.Op) on formulas, or a predicate.

    Equal formulas share one graph node, but each has its own Truth with its name and place.
    """

    node: int
    operation: str = ""
    parts: tuple["Truth", ...] = ()
    data: tuple[object, ...] = ()
    predicate: Predicate | None = None
    name: str | None = None  # its name, if it is a named sub-formula
    span: Span | None = None  # None for what is only a part of an operator's meaning


@dataclass(frozen=True, slots=True)
class Region:
    """A ball or box of constant size and place that a formula speaks of, for pictures of the workspace.

    `name` is the named sub-formula that holds it (None in the spec's own line). `signal` is its vector signal (None for
    an expression). `inside` says whether the formula anywhere asks to be in it; otherwise it only asks to keep out, as
    in distance(...) > radius or under a negation. A ball has `centre` and `radius`, a box `lower` and `upper`.
    """

    name: str | None
    kind: str
    signal: str | None
    inside: bool
    centre: tuple[float, ...] | None = None
    radius: float | None = None
    lower: tuple[float, ...] | None = None
    upper: tuple[float, ...] | None = None


@dataclass(frozen=True, slots=True)
class Meaning:
    """Everything that evaluation needs. Numbers are nodes of `graph`; times are in steps."""

    document: syntax.Document  # with the effective constants
    graph: Graph
    formula: Truth
    root: int  # its node
    start: int  # a node with the same value at the first sample
    signals: dict[str, int | None]
    signal_spans: dict[str, Span]
    booleans: frozenset[str]  # the signals that are true or false
    constants: dict[str, Value | dict[str, Value]]
    definitions: dict[str, tuple[Truth, str]]  # named sub-formulas in order, with their text
    places: dict[int, Predicate]  # of arithmetic nodes that can fail
    period: float | None  # between two samples, s
    durations: frozenset[str]  # names of the constants that are in seconds
    timed: Span | None  # of the first bound in seconds
    regions: tuple[Region, ...]

    @property
    def predicates(self) -> dict[str, int]:
        """The predicates of the formula and their nodes."""
        found: dict[str, int] = {}
        stack, seen = [self.formula], set()
        while stack:
            truth = stack.pop()
            if truth.predicate is not None:
                found[truth.predicate.text] = truth.node
            elif truth not in seen:
                seen.add(truth)
                stack.extend(truth.parts)
        return found

    @property
    def looks_back(self) -> bool:
        """Whether the formula looks at earlier samples."""
        return any(self.graph.looks_back)


def asked(formula: Truth, conditions: Mapping[int, Truth]) -> set[tuple[int, bool]]:
    """Pairs (node of a predicate, whether the formula asks for it or for its opposite); both pairs if it asks for both.

    Under an even number of negations it asks for the predicate: every other operation increases with its operands.
    `conditions` are the conditions in holds(...), by node; they are followed too.
    """
    found: set[tuple[Truth, bool]] = set()
    stack = [(formula, True)]
    while stack:
        part, wanted = stack.pop()
        if (part, wanted) not in found:
            found.add((part, wanted))
            stack += [(below, wanted != (part.operation == "negative")) for below in part.parts]
            if part.node in conditions:
                stack.append((conditions[part.node], wanted))
    return {(part.node, wanted) for part, wanted in found if part.predicate is not None}
