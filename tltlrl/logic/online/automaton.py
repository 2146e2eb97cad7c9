"""A term as a max-min automaton: one number per state, and the robustness of every prefix.

Every formula can be written by what it asks of this sample and of the next:

    G f = f & X G f        F f = f | X[!] F f        p U q = q | p & X[!] (p U q)        p R q = q & (p | X (p R q))

Multiplied out, a formula is a maximum of branches, each a minimum of a guard (literals at this sample) and of
obligations for the next. A state is a set of obligations; alpha_t(S') is the maximum over the branches S -> S' of
min(alpha_{t-1}(S), guard_t). A trajectory may end in the states without
strong obligations; the maximum of alpha over them is the robustness. It is exact, because only laws of a distributive
lattice are used (and not that p | !p holds).
"""

from collections.abc import Iterable, Set
from dataclasses import dataclass, field

from tltlrl.logic.graph import FOREVER
from tltlrl.logic.online.terms import Obligation, Obligations, Terms

Guard = frozenset[int]  # literals
Branch = tuple[Guard, Obligations]
_NONE: Guard = frozenset()
_DONE: Obligations = frozenset()
MOST_STATES = 200
MOST_COMPARISONS = 300_000  # of branches and obligations, for one automaton: about 0.3 s


class TooLargeError(Exception):
    """The automaton of a term has too many states, or takes too long to make."""


@dataclass(frozen=True, slots=True)
class Automaton:
    """States are numbered; a trajectory starts in state 0.

    Attributes:
      states: the obligations for the next sample in each state.
      transitions: (from, guard, to).
    """

    states: tuple[Obligations, ...]
    transitions: tuple[tuple[int, Guard, int], ...]

    def ending(self) -> frozenset[int]:
        """The states in which a trajectory may end."""
        return frozenset(i for i, state in enumerate(self.states) if not any(strong for strong, _ in state))

    def hopeful(self, never: Set[int]) -> frozenset[int]:
        """The states from which one can come to end, when all literals are at their best but those in `never`."""
        found = self.ending()
        while more := self._before(found, never) - found:
            found |= more
        return found

    def secured(self, forever: Set[int]) -> list[frozenset[int]]:
        """The sets of states of which one must be reached, however many samples follow, when all literals are at
        their worst but those in `forever`; sets that hold another are left out."""
        now, sets = self.ending(), list[frozenset[int]]()
        while now not in sets:
            sets.append(now)
            now = frozenset(a for a, guard, b in self.transitions if b in now and guard <= forever)
        return [one for one in sets if not any(other < one for other in sets)]

    def distances(self) -> list[float]:
        """From each state, the fewest guards on a way to a state in which a trajectory may end."""
        far = [0.0 if i in self.ending() else float("inf") for i in range(len(self.states))]
        for _ in self.states:
            for a, guard, b in self.transitions:
                far[a] = min(far[a], far[b] + (1.0 if guard else 0.0))
        return far

    def _before(self, states: Set[int], never: Set[int]) -> frozenset[int]:
        return frozenset(a for a, guard, b in self.transitions if b in states and not guard & never)


@dataclass(slots=True)
class Expansion:
    """Computes what the terms of a spec ask of one sample and of the next."""

    terms: Terms
    _branches: dict[int, tuple[Branch, ...]] = field(default_factory=dict)
    _compared: int = 0

    def automaton(self, term: int) -> Automaton:
        """The automaton of a term that is read from the first sample on.

        Raises:
          TooLargeError: if it has too many states, or branches to compare.
        """
        self._compared = 0
        start: Obligations = frozenset({(True, term)})
        number, todo = {start: 0}, [start]
        transitions = []
        while todo:
            state = todo.pop()
            for guard, after in self.of_all(state):
                if after not in number:
                    if len(number) == MOST_STATES:
                        raise TooLargeError
                    number[after] = len(number)
                    todo.append(after)
                transitions.append((number[state], guard, number[after]))
        return _trimmed(Automaton(tuple(number), tuple(transitions)))

    def of_all(self, obligations: Obligations) -> tuple[Branch, ...]:
        """The branches of a conjunction."""
        result: tuple[Branch, ...] = ((_NONE, _DONE),)
        for _, term in sorted(obligations):
            result = self._both(result, self.of(term))
        return result

    def of(self, term: int) -> tuple[Branch, ...]:
        """The branches of a term.

        Raises:
          TooLargeError: if there are too many to compare.
        """
        if term not in self._branches:
            self._branches[term] = self._of(term)
        return self._branches[term]

    def _of(self, term: int) -> tuple[Branch, ...]:
        terms, op = self.terms, self.terms.graph.ops[term]

        def after(strong: bool, later: int) -> tuple[Branch, ...]:
            return ((_NONE, frozenset({(strong, later)})),)

        match op.name, op.data:
            case (("literal" | "clock" | "bounded"), _):
                return ((frozenset({term}), _DONE),)
            case "minimum", _:
                result = self.of(op.args[0])
                for arg in op.args[1:]:
                    result = self._both(result, self.of(arg))
                return result
            case "maximum", _:
                return self._either(*map(self.of, op.args))
            case "next", (int(steps), bool(strong)):
                return after(strong, terms.later(op.args[0], steps - 1, strong))
            case ((("always" | "eventually") as name), (window,)):
                low, high = window if isinstance(window, tuple) else (0, FOREVER)
                bounds = (max(low - 1, 0), high - 1)
                again = term if window is None else terms.graph.add(name, op.args[0], data=(bounds,))
                later = after(name == "eventually", again)
                if low > 0:
                    return later
                if high == 0:
                    return self.of(op.args[0])
                join = self._both if name == "always" else self._either
                return join(self.of(op.args[0]), later)
            case "until", _:
                p, q = map(self.of, op.args)
                return self._either(q, self._both(p, after(True, term)))
            case "release", _:
                p, q = map(self.of, op.args)
                return self._both(q, self._either(p, after(False, term)))
            case "chop", (frozenset() as left, int(low), int(high)):
                return self._chop(left, op.args[0], low, high)
            case "refuse", _:
                return self._negated(self.of(op.args[0]))
        raise AssertionError(op)

    def _chop(self, left: Obligations, right: int, low: int, high: int) -> tuple[Branch, ...]:
        now: tuple[Branch, ...] = ()
        if low == 0 and not any(strong for strong, _ in left):
            now = self.of(right)
        if high == 0:
            return now
        less = max(low - 1, 0), high if high == FOREVER else high - 1
        later = tuple(
            (guard, frozenset({(True, self.terms.chop(rest, right, *less))})) for guard, rest in self.of_all(left)
        )
        return self._either(now, later)

    def _negated(self, branches: tuple[Branch, ...]) -> tuple[Branch, ...]:
        """The negation of a maximum of minima, multiplied out."""
        negation = self.terms.negation
        result: tuple[Branch, ...] = ((_NONE, _DONE),)
        for guard, rest in branches:
            literals = tuple((frozenset({negation(literal)}), _DONE) for literal in guard)
            others = tuple((_NONE, frozenset({(not strong, negation(term))})) for strong, term in rest)
            result = self._both(result, literals + others)
        return result

    def _both(self, a: tuple[Branch, ...], b: tuple[Branch, ...]) -> tuple[Branch, ...]:
        self._compare(len(a) * len(b))
        pairs = ((g | h, self._reduced(m | n)) for g, m in a for h, n in b)
        return self._absorbed(pair for pair in pairs if self._possible(pair[0]))

    def _either(self, *parts: tuple[Branch, ...]) -> tuple[Branch, ...]:
        return self._absorbed(branch for part in parts for branch in part)

    def _absorbed(self, branches: Iterable[Branch]) -> tuple[Branch, ...]:
        """Without branches that ask for all that another one asks."""
        kept: list[Branch] = []
        for guard, rest in sorted(set(branches), key=_by_size):
            self._compare(len(kept))
            if not any(g <= guard and all(self._follows(o, rest) for o in n) for g, n in kept):
                kept = [(g, n) for g, n in kept if not (guard <= g and all(self._follows(o, n) for o in rest))]
                kept.append((guard, rest))
        return tuple(kept)

    def _compare(self, count: int) -> None:
        self._compared += count
        if self._compared > MOST_COMPARISONS:
            raise TooLargeError

    def _follows(self, obligation: Obligation, others: Obligations) -> bool:
        """Whether one of the others implies an obligation."""
        if obligation in others:
            return True
        self._compare(len(others))
        strong, term = obligation
        return any(own >= strong and self.terms.implies(other, term) for own, other in others)

    def _reduced(self, obligations: Obligations) -> Obligations:
        """Without those that another one implies."""
        if len(obligations) < 2:
            return obligations
        kept = obligations
        for one in sorted(obligations):
            if self._follows(one, kept - {one}):
                kept -= {one}
        return kept

    def _possible(self, guard: Guard) -> bool:
        """Whether there is a step at which no clock of a guard is -inf."""
        low, high, gaps = 0, FOREVER, []
        for literal in guard:
            op = self.terms.graph.ops[literal]
            if op.name == "clock":
                a, b, inside = op.data
                assert isinstance(a, int)
                assert isinstance(b, int)
                if inside:
                    low, high = max(low, a), min(high, b)
                else:
                    gaps.append((a, b))
        return low <= high and not any(a <= low and high <= b for a, b in gaps)


def _by_size(branch: Branch) -> tuple[int, list[int], list[Obligation]]:
    guard, rest = branch
    return len(guard) + len(rest), sorted(guard), sorted(rest)


def _trimmed(whole: Automaton) -> Automaton:
    """Without the states from which no trajectory can come to end; the first state stays."""
    kept = sorted({0} | whole.hopeful(frozenset()))
    number = {old: new for new, old in enumerate(kept)}
    return Automaton(
        tuple(whole.states[i] for i in kept),
        tuple((number[a], guard, number[b]) for a, guard, b in whole.transitions if a in number and b in number),
    )
