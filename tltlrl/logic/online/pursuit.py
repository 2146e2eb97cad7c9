"""Follows the conjuncts of a spec while trajectories run; their automata step together, on one array (`together`).

A long window inside an unbounded operator can make the automaton of a conjunct too large. Then the automaton runs as
many steps late as the window is long, and the samples since then are evaluated as a slice (`slices`). Where that does
not help, the whole past is kept. This is exact too, but gets slower with time.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tltlrl.logic.graph import FOREVER, Array, Graph
from tltlrl.logic.online.automaton import Automaton, Expansion, TooLargeError
from tltlrl.logic.online.memory import Memory
from tltlrl.logic.online.sheet import Layout
from tltlrl.logic.online.slices import Ahead, Slice
from tltlrl.logic.online.terms import Terms, UnsupportedError
from tltlrl.logic.online.together import Indices, Summary, Together
from tltlrl.logic.semantics import Signals, plan

Clock = tuple[int, int, bool]  # low, high, inside


@dataclass(frozen=True, slots=True)
class Clause:
    """One conjunct of a spec.

    Attributes:
      term: the conjunct.
      automaton: of it; of the term with its bounded parts in brackets, when there is a delay; None if too large.
      delay: how many samples the automaton is behind.
    """

    term: int
    automaton: Automaton | None
    delay: int = 0

    @property
    def is_slow(self) -> bool:
        """Whether past samples have to be kept."""
        return self.automaton is None or self.delay > 0


@dataclass(frozen=True)
class Compiled:
    """A spec, ready to be monitored.

    Attributes:
      terms: of the spec.
      clauses: its conjuncts.
      others: nodes of the spec's graph whose values complete the minimum; no term says what they do.
    """

    terms: Terms
    clauses: tuple[Clause, ...]
    others: tuple[int, ...] = ()
    _layouts: dict[tuple[int, ...], Layout] = field(default_factory=dict)

    @cached_property
    def literals(self) -> tuple[int, ...]:
        """Terms that are an atom, its negation, or a clock; clocks come last."""
        ops = self.terms.graph.ops
        guards = (guard for clause in self.clauses if clause.automaton for _, guard, _ in clause.automaton.transitions)
        slow = self.terms.below(clause.term for clause in self.clauses if clause.is_slow)
        named = slow.union(*guards)
        return tuple(term for name in ("literal", "clock") for term in sorted(named) if ops[term].name == name)

    @cached_property
    def clocks(self) -> dict[int, Clock]:
        """Literal => what it says, for the clocks among them."""
        ops = self.terms.graph.ops
        return {term: _clock(ops[term].data) for term in self.literals if ops[term].name == "clock"}

    @cached_property
    def atoms(self) -> dict[int, tuple[int, bool]]:
        """Literal => node of the spec's graph and sign, for the others."""
        ops = self.terms.graph.ops
        return {term: _atom(ops[term].data) for term in self.literals if ops[term].name == "literal"}

    @cached_property
    def values(self) -> tuple[tuple[int, bool], ...]:
        """What the rows of literals are: nodes of the spec's graph and their signs. The first is +inf; so are, until
        the time is known, the clocks."""
        infinite = self.terms.source.add("constant", data=(np.inf,)), True
        return (infinite, *self.atoms.values(), *[infinite] * len(self.clocks))

    def memory(self, count: int) -> Memory:
        """A memory for the past of `count` trajectories."""
        graph = self.terms.source
        of_others = (node for node in graph.below(self.others) if graph.local[node])
        return Memory(graph, {*(node for node, _ in self.values), *of_others}, count, self._layout_of)

    def _layout_of(self, nodes: Iterable[int]) -> Layout:
        key = tuple(sorted(nodes))
        if key not in self._layouts:
            self._layouts[key] = Layout.of(self.terms.source, key)
        return self._layouts[key]

    @cached_property
    def quick(self) -> "Together":
        """The automata that are up to date, as one."""
        own = [clause.automaton for clause in self.clauses if clause.automaton is not None and not clause.is_slow]
        return Together.of(own, self.literals)


def _clock(data: tuple[object, ...]) -> Clock:
    low, high, inside = data
    assert isinstance(low, int)
    assert isinstance(high, int)
    return low, high, bool(inside)


def _atom(data: tuple[object, ...]) -> tuple[int, bool]:
    node, sign = data
    assert isinstance(node, int)
    return node, bool(sign)


def compiled(graph: Graph, root: int) -> Compiled:
    """Make ready to monitor a node of a spec's graph.

    Raises:
      RecursionError: for a formula that nests too deep.
    """
    terms = Terms(graph)
    expansion = Expansion(terms)
    found: dict[int, None] = {}
    others = []
    for part in _parts(graph, root):
        try:
            found.update(dict.fromkeys(terms.conjuncts(terms.from_start(part))))
        except UnsupportedError:
            others.append(part)
    return Compiled(terms, tuple(_clause(terms, expansion, term) for term in found), tuple(others))


def _parts(graph: Graph, node: int) -> list[int]:
    """The nodes whose minimum it is."""
    op = graph.ops[node]
    if op.name != "minimum" or graph.local[node]:
        return [node]
    return [part for arg in op.args for part in _parts(graph, arg)]


def _clause(terms: Terms, expansion: Expansion, term: int) -> Clause:
    for read in (term, terms.with_bounded(term)):
        try:
            automaton = expansion.automaton(read)
        except TooLargeError:
            continue
        delays = [
            terms.graph.ops[one].data[0] for _, g, _ in automaton.transitions for one in g if _is_bounded(terms, one)
        ]
        return Clause(term, automaton, max((d for d in delays if isinstance(d, int)), default=0))
    return Clause(term, None)


def _is_bounded(terms: Terms, term: int) -> bool:
    return terms.graph.ops[term].name == "bounded"


class Quick:
    """Clauses whose automata are up to date.

    Attributes:
      together: all of them.
      alpha: the states' values, (states, N).
    """

    def __init__(self, spec: Compiled, count: int) -> None:
        self._spec, self.together = spec, spec.quick
        self.alpha = self.together.start(count)
        own = {literal for one in self.together.automata for _, guard, _ in one.transitions for literal in guard}
        self._clocks = {literal: clock for literal, clock in spec.clocks.items() if literal in own}
        self._summaries: dict[tuple[frozenset[int], frozenset[int]], Summary] = {}
        self._turns = {edge for low, high, _ in self._clocks.values() for edge in (low - 1, high)}
        self._summary = self._summary_after(-1)

    def update(self, literals: Array, step: int) -> tuple[Array, Array, Array]:
        """Reads one more sample, the values of its literals, (1 + literals, N): robustness, lower, upper."""
        self.alpha = self.together.step(self.alpha, literals)
        if step in self._turns or step == 0:
            self._summary = self._summary_after(step)
        return self._summary.read(self.alpha)

    def _summary_after(self, step: int) -> Summary:
        """What is looked at when the next sample is step + 1."""
        key = settled(self._clocks, step)
        if key not in self._summaries:
            self._summaries[key] = Summary.of(self.together, *key)
        return self._summaries[key]

    def keep(self, rows: Indices) -> None:
        """Follow only these of the trajectories."""
        self.alpha = self.alpha[:, rows]

    def state(self) -> Array:
        """What later values depend on, (rows, N)."""
        return self.alpha[1:]


class Late:
    """A clause whose automaton is some samples behind; without an automaton, it never starts.

    Attributes:
      together: the automaton.
      alpha: the states' values, (states, N).
    """

    def __init__(self, spec: Compiled, clause: Clause, count: int) -> None:
        self._spec, self._clause = spec, clause
        automaton = clause.automaton or Automaton((frozenset({(True, clause.term)}),), ())
        self._bounded = sorted({one for _, guard, _ in automaton.transitions for one in guard} - set(spec.literals))
        self.together = Together.of([automaton], (*spec.literals, *self._bounded))
        self.alpha = self.together.start(count)
        self._past: list[Array] = []  # one (1 + literals, N) per sample that the automaton has not seen

    def update(self, literals: Array, step: int) -> tuple[Array, Array, Array]:
        """Reads one more sample, the values of its literals, (1 + literals, N): robustness, lower, upper."""
        self._past.append(literals)
        if self._clause.automaton is not None and len(self._past) > self._clause.delay:
            oldest = self._slice(None)
            bounded = [oldest.of(term)[:, 0] for term in self._bounded]
            self.alpha = self.together.step(self.alpha, np.stack([*self._past.pop(0), *bounded]))
        never, forever = settled(self._spec.clocks, step)
        return self._read(None), self._read(Ahead(False, never, forever)), self._read(Ahead(True, never, forever))

    def _slice(self, ahead: Ahead | None) -> Slice:
        values = np.stack(self._past, axis=2)
        return Slice(self._spec.terms, dict(zip(self._spec.literals, values[1:], strict=True)), ahead)

    def _read(self, ahead: Ahead | None) -> Array:
        """The best way through a state, and its obligations on the samples since then."""
        (automaton,), best = self.together.automata, self.alpha[0]
        rest = self._slice(ahead)
        for state, alpha in zip(automaton.states, self.alpha[1:], strict=True):
            best = np.maximum(best, np.minimum(alpha, rest.all_of(state)[:, 0]))
        return best

    def keep(self, rows: Indices) -> None:
        """Follow only these of the trajectories."""
        self.alpha, self._past = self.alpha[:, rows], [literals[:, rows] for literals in self._past]

    def state(self) -> Array | None:
        """What later values depend on, (rows, N); None where that grows."""
        if self._clause.automaton is None:
            return None
        missing = self._clause.delay - len(self._past)
        nothing = np.full((missing * (1 + len(self._spec.literals)), self.alpha.shape[1]), np.nan)
        return np.concatenate([self.alpha[1:], *self._past, nothing])


class Whole:
    """A node that no term says, such as the past of a future: evaluated on all samples each time, without bounds."""

    def __init__(self, graph: Graph, node: int) -> None:
        self._graph, self._node = graph, node
        self._past: list[Signals] = []

    def update(self, block: Signals) -> tuple[Array, Array, Array]:
        """Reads one more sample, its signals, (N, 1): robustness, lower, upper."""
        self._past.append({key: np.array(values) for key, values in block.items()})
        signals = {key: np.concatenate([one[key] for one in self._past], axis=1) for key in block}
        steps = len(self._past)
        value = plan(self._graph, {self._node: (0, 1)}, steps).run(signals)[self._node][:, 0]
        return value, np.full_like(value, -np.inf), np.full_like(value, np.inf)

    def keep(self, rows: Indices) -> None:
        """Follow only these of the trajectories."""
        self._past = [{key: values[rows] for key, values in one.items()} for one in self._past]


def settled(clocks: Mapping[int, Clock], step: int) -> tuple[frozenset[int], frozenset[int]]:
    """The clocks that are -inf at all steps after `step`, and those that are +inf."""
    never, forever = set[int](), set[int]()
    for literal, (low, high, inside) in clocks.items():
        if high <= step:
            (never if inside else forever).add(literal)
        elif low <= step + 1 and high == FOREVER:
            (forever if inside else never).add(literal)
    return frozenset(never), frozenset(forever)
