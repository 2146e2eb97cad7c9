"""Syntax tree => meaning: resolves names, dimensions, constants and families, and reports every mistake."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from typing import Any

from tltlrl.errors import nearest
from tltlrl.logic import syntax
from tltlrl.logic.declarations import (
    FUNCTIONS,
    NUMBERS,
    Declarations,
    Value,
    check_binding,
    declare,
    overridden,
)
from tltlrl.logic.errors import Source, Span, SpecError, elsewhere
from tltlrl.logic.graph import FOREVER, Graph
from tltlrl.logic.meaning import Meaning, Predicate, Region, Truth, asked
from tltlrl.logic.operators import (
    Window,
    both,
    change,
    cut,
    either,
    implication,
    looking_back,
    negation,
    operation,
    previous,
    reduced,
    since,
    then,
    until,
    until_or_cut,
    weak_until,
)
from tltlrl.logic.shortcut import at_start
from tltlrl.logic.syntax import Node
from tltlrl.logic.windows import samples_in, steps_of

_OF_SCALARS = {"abs": "absolute"} | {
    name: name
    for name in ("sqrt", "exp", "sin", "cos", "tan", "asin", "acos", "atan2", "wrap", "log", "mod", "floor", "sign")
}
MAX_CALLS = 1000  # calls of functions that the text defines, with different arguments
MAX_DEPTH = 150  # of operators in the bodies of functions that call each other
_ARITHMETIC = {"+": "add", "-": "subtract", "*": "multiply", "/": "divide", "**": "power"}


@dataclass(frozen=True, slots=True)
class Expression:
    """A number (dimension None) or a vector, as one graph node per component; a duration is a number of seconds."""

    components: tuple[int, ...]
    dimension: int | None = None
    is_duration: bool = False


@dataclass(frozen=True, slots=True)
class Bound:
    """What a parameter stands for: a number or a formula, and its text."""

    value: "Expression | Truth"
    node: Node


# What stands for the labels' variables and the parameters around a formula.
Scope = Mapping[str, str | Bound]


def resolve(
    source: Source, document: syntax.Document, overrides: Mapping[str, object] | None, period: float | None = None
) -> Meaning:
    """The meaning of a spec, with every name resolved.

    If a bound is in seconds and no period is known, windows stay unresolved, and the meaning cannot be evaluated.

    Args:
      source, document: the spec's text and syntax tree.
      overrides: values in place of the spec's own constants.
      period: time between two samples, s.

    Raises:
      SpecError: at the first thing that has no meaning.
    """
    document = _with_computed(source, document, overrides)
    return _Resolver(source, declare(source, document, overrides, period)).meaning()


def _with_computed(
    source: Source, document: syntax.Document, overrides: Mapping[str, object] | None
) -> syntax.Document:
    """The document with numbers in place of constants' expressions.

    Raises:
      SpecError: if an expression uses anything but constants.
    """
    constants = {(d.name, d.label): d for d in document.declarations if isinstance(d, syntax.Constant)}
    trees = {key: d.value for key, d in constants.items() if isinstance(d.value, Node)}
    if not trees:
        return document
    names = {name for name, _ in constants}
    uses: dict[tuple[str, str | None], set[tuple[str, str | None]]] = {}
    for key, tree in trees.items():
        uses[key] = set()
        for node, _ in syntax.walk(tree):
            if isinstance(node, syntax.Name) and node.name not in names | NUMBERS.keys():
                raise SpecError(
                    source,
                    node.span,
                    f"'{node.name}' is no constant; expected numbers and constants, for a constant never changes; name "
                    "an expression of signals with 'let'",
                )
            name, label = (node.base, node.label) if isinstance(node, syntax.Index) else (node, None)
            if isinstance(name, syntax.Name):
                uses[key] |= {(name.name, label), (name.name, None)} & trees.keys()
    try:
        order = list(TopologicalSorter(uses).static_order())
    except CycleError as cycle:
        first = constants[cycle.args[1][0]]
        raise SpecError(
            source,
            first.span,
            f"the constant '{_title(*cycle.args[1][0])}' is computed from itself; expected numbers "
            "or other constants; break the circle",
        ) from None
    placeholders = tuple(
        replace(d, value=0.0) if isinstance(d, syntax.Constant) and isinstance(d.value, Node) else d
        for d in document.declarations
    )
    given = {} if overrides is None else overrides
    known = (
        given
        if not isinstance(given, Mapping)
        else {name: value for name, value in given.items() if not any(name == own for own, _ in trees)}
    )
    declared = declare(source, replace(document, declarations=placeholders), known, None)
    resolver = _Resolver(source, declared)
    resolver.add_constants()
    computed: dict[tuple[str, str | None], syntax.Constant] = {}
    for key in order:
        value = resolver.amount(trees[key], {})
        numbers = resolver.fixed(trees[key], value, "constant")
        own = replace(
            constants[key], value=numbers[0] if value.dimension is None else numbers, is_duration=value.is_duration
        )
        computed[key] = own
        resolver.add_constant(key, overridden(source, own, given), value.is_duration)
    return replace(
        document,
        declarations=tuple(
            computed.get((d.name, d.label), d) if isinstance(d, syntax.Constant) else d for d in document.declarations
        ),
    )


class _Resolver:
    """One pass over one document; its attributes are the tables that the pass fills."""

    def __init__(self, source: Source, declared: Declarations) -> None:
        self.source = source
        self.declared = declared
        self.graph = Graph()
        self.results: dict[tuple[str, str | None], Expression | Truth] = {}
        self.places: dict[int, Predicate] = {}
        self.regions: list[tuple[Region, int]] = []  # each with the node of its predicate
        self.conditions: dict[int, Truth] = {}  # by the node of the holds(...) around them
        self.distances: dict[int, tuple[Node, tuple[float, ...]]] = {}  # of a point from a fixed one
        self.within: str | None = None  # the named sub-formula being read
        self.timed: Span | None = None
        self.functions = {
            d.name: d for d in declared.document.declarations if isinstance(d, syntax.Definition) and d.parameters
        }
        self.called: dict[str, Expression | Truth] = {}  # text of a call -> its meaning
        self.depth = 0  # of the functions that are being read

    def error(self, node: Node | Span, problem: str) -> SpecError:
        return SpecError(self.source, node if isinstance(node, Span) else node.span, problem)

    # The pass

    def meaning(self) -> Meaning:
        definitions = {d.name: d for d in self.declared.document.declarations if isinstance(d, syntax.Definition)}
        for name, key in self.declared.members.items():
            self.results[key] = self._signal(name)
        self.add_constants()
        if not self.declared.signals:
            raise self.error(
                self.declared.document.formula,
                "the formula holds no signal; expected one at least; write what it says of a trajectory",
            )
        ordered, used = self._order(definitions)
        for name in ordered:
            if name in used:
                self._define(definitions[name])
        formula = self.truth(self.declared.document.formula, {})
        for name in ordered:
            if name not in used:  # last, for equal expressions have the place where the first one stands
                self._define(definitions[name])
        order = [
            (title, label, result, d)
            for name, d in definitions.items()
            if not d.parameters
            for label in d.labels or (None,)
            if isinstance(result := self.results[name, label], Truth)
            for title in [_title(name, label)]
        ]
        titles: list[str | None] = [*(title for title, *_ in order), None, *self.called]
        wanted = asked(formula, self.conditions)
        regions = [
            replace(region, inside=(node, region.inside) in wanted)  # asked for inside, or its opposite for outside
            for region, node in self.regions
        ]
        return Meaning(
            self.declared.document,
            self.graph,
            formula,
            formula.node,
            at_start(self.graph, formula.node),
            self.declared.signals,
            self.declared.signal_spans,
            self.declared.booleans,
            self.declared.constants,
            {
                title: (truth, str(_as_read(d.body, {d.variable: label} if d.variable and label else {})))
                for title, label, truth, d in order
            },
            self.places,
            self.declared.period,
            frozenset(name for name, _ in self.declared.durations),
            self.timed,
            tuple(dict.fromkeys(r for title in titles for r in regions if r.name == title)),
        )

    def add_constants(self) -> None:
        for name, constant in self.declared.constants.items():
            for label, value in constant.items() if isinstance(constant, dict) else [(None, constant)]:
                self.add_constant((name, label), value, (name, label) in self.declared.durations)

    def add_constant(self, key: tuple[str, str | None], value: Value, is_duration: bool) -> None:
        self.results[key] = replace(self._number(value), is_duration=is_duration)

    def _order(self, definitions: dict[str, syntax.Definition]) -> tuple[list[str], set[str]]:
        """The definitions, each after those it uses, and which of them the spec's formula uses."""

        def named(tree: Node) -> set[str]:
            nodes = [node for node, _ in syntax.walk(tree)]
            names = {node.name for node in nodes if isinstance(node, syntax.Name)}
            return (names | {node.function for node in nodes if isinstance(node, syntax.Call)}) & definitions.keys()

        uses = {name: named(d.body) for name, d in definitions.items()}
        try:
            ordered = list(TopologicalSorter(uses).static_order())
        except CycleError as cycle:
            names: list[str] = cycle.args[1][::-1]
            first = next(n for n in definitions if n in names)
            names = names[:-1]
            names = names[names.index(first) :] + names[: names.index(first)] + [first]
            circle = " -> ".join(f"'{name}'" for name in names)
            raise self.error(
                definitions[first],
                f"cyclic definition: {circle}; expected each to use others only; break the circle",
            ) from None
        used = named(self.declared.document.formula)
        for name in reversed(ordered):
            if name in used:
                used |= uses[name]
        return ordered, used

    def _define(self, d: syntax.Definition) -> None:
        if d.parameters:  # read where it is called; but an unknown name is reported at once
            for node, _ in syntax.walk(d.body):
                if isinstance(node, syntax.Name) and node.name not in {*d.parameters, *self.declared.names, *NUMBERS}:
                    self._name(node, {})
            return
        for label in d.labels or (None,):
            scope: Scope = {d.variable: label} if d.variable and label else {}
            if d.keyword == "let":
                self.results[d.name, label] = self.amount(d.body, scope, f"name a formula by 'def {d.name}: ...'")
                continue
            self.within = _title(d.name, label)
            truth = self.truth(d.body, scope)
            self.results[d.name, label] = truth if truth.name else replace(truth, name=self.within)
            self.within = None

    def _signal(self, name: str) -> Expression:
        dimension = self.declared.signals[name]
        parts = [None] if dimension is None else range(dimension)
        return Expression(tuple(self.graph.add("signal", data=(name, part)) for part in parts), dimension)

    def _number(self, value: Value) -> Expression:
        if isinstance(value, tuple):
            return Expression(tuple(self.graph.add("constant", data=(v,)) for v in value), len(value))
        return Expression((self.graph.add("constant", data=(value,)),))

    # Names

    def _found(self, node: Node, key: tuple[str, str | None], scope: Scope) -> Expression | Truth:
        """What a name means; a signal that is true or false is a formula."""
        result, title = self.results[key], _title(*key)
        if title not in self.declared.booleans:
            return result
        assert isinstance(result, Expression)
        margin = self.graph.add("subtract", *result.components, self.graph.add("constant", data=(0.5,)))
        return self._predicate(node, self.graph.add("holds", margin), scope)

    def _name(self, node: syntax.Name, scope: Scope) -> Expression | Truth:
        bound = scope.get(node.name)
        if isinstance(bound, Bound):
            return bound.value
        if node.name in self.declared.families:
            labels = self.declared.families[node.name]
            raise self.error(
                node,
                f"'{node.name}' is a family; expected one of its members; write {node.name}[{labels[0]}]",
            )
        if (node.name, None) in self.results:
            return self._found(node, (node.name, None), scope)
        if node.name in self.functions:
            parameters = ", ".join(self.functions[node.name].parameters)
            raise self.error(
                node, f"'{node.name}' has parameters; expected its arguments; write {node.name}({parameters})"
            )
        if node.name in NUMBERS:
            return self._number(NUMBERS[node.name])
        if node.name in scope:
            raise self.error(
                node,
                f"'{node.name}' is a label; expected a number; a label can only stand in brackets, as "
                f"in goal[{node.name}]",
            )
        if node.name in FUNCTIONS:
            raise self.error(node, f"'{node.name}' is a function; expected its arguments; write {node.name}(...)")
        near = nearest(node.name, [*self.declared.names, *FUNCTIONS]).removeprefix("; ")
        declare = near if near.startswith("did") else f"declare it, for instance with 'signal {node.name}'"
        advice = elsewhere(node.name) or declare
        raise self.error(node, f"unknown name '{node.name}'; expected a declared one; {advice}")

    def _index(self, node: syntax.Index, scope: Scope) -> Expression | Truth:
        base, bound = node.base, scope.get(node.label)
        label = bound if isinstance(bound, str) else node.label
        if isinstance(base, syntax.Name) and base.name in self.declared.families:
            labels = self.declared.families[base.name]
            if label not in labels:
                raise self.error(
                    node,
                    f"'{base.name}' has no member '{label}'; expected one of its own{nearest(label, labels)}",
                )
            return self._found(node, (base.name, label), scope)
        vector = self.vector(base, scope, f"only a vector or a family has a member [{label}]")
        components = {str(i): component for i, component in enumerate(vector.components)}
        if label not in components:
            raise self.error(
                node,
                f"'{base}' has no component [{label}]; expected 0 to {len(components) - 1}; correct the index",
            )
        return Expression((components[label],))

    def _component(self, node: syntax.Component, scope: Scope) -> Expression:
        advice = f"only a vector has a component .{node.axis}"
        vector = self.vector(node.base, scope, advice)
        axes = "xyz"[: len(vector.components)]
        if node.axis not in tuple(axes):
            raise self.error(
                node,
                f"'{node.base}' has no component .{node.axis}; expected one of "
                f"{', '.join(f'.{a}' for a in axes)}; correct it or write an index, as in [0]",
            )
        return Expression((vector.components[axes.index(node.axis)],))

    # Numbers

    def evaluate(self, node: Node, scope: Scope) -> Expression | Truth:
        """The meaning of a tree that may be a number or a formula."""
        match node:
            case syntax.Name():
                return self._name(node, scope)
            case syntax.Index():
                return self._index(node, scope)
            case syntax.Component():
                return self._component(node, scope)
            case syntax.Number(value):
                if not math.isfinite(value):
                    raise self.error(node, "this number is too large for a float; expected a finite one; write one")
                return self._number(value)
            case syntax.Duration(seconds):
                return replace(self._number(seconds), is_duration=True)
            case syntax.Vector(items):
                return Expression(tuple(self.scalar(item, scope) for item in items), len(items))
            case syntax.Negative(a):
                q = self.amount(a, scope)
                return replace(q, components=tuple(self.graph.add("negative", c) for c in q.components))
            case syntax.Arithmetic():
                return self._arithmetic(node, scope)
            case syntax.Boolean(is_true):
                infinite = self.graph.add("constant", data=(math.inf if is_true else -math.inf,))
                return Truth(infinite, predicate=Predicate(str(node), node.span))
            case syntax.Call():
                return self._call(node, scope)
            case _:
                return self._formula(node, scope)

    def amount(
        self, node: Node, scope: Scope, advice: str = "only numbers are compared and computed with"
    ) -> Expression:
        """A number, a vector or a duration; `advice` is for a formula in its place."""
        result = self.evaluate(node, scope)
        if isinstance(result, Truth):
            if str(_as_read(node, scope)) in self.declared.booleans:
                advice = f"'{node}' is true or false, a formula as it stands: delete the comparison"
            raise self.error(node, f"found a formula; expected a number; {advice}")
        return result

    def quantity(self, node: Node, scope: Scope) -> Expression:
        """A number or a vector."""
        result = self.amount(node, scope)
        if result.is_duration:
            raise self.error(
                node,
                "found a duration; expected a number; durations are for the bounds of an interval: divide it by 1 s",
            )
        return result

    def scalar(self, node: Node, scope: Scope) -> int:
        result = self.quantity(node, scope)
        if result.dimension is not None:
            raise self.error(
                node,
                f"found a vector of {result.dimension}; expected a scalar; take a component (.x, [0]), "
                "norm(...) or distance(..., ...)",
            )
        return result.components[0]

    def vector(self, node: Node, scope: Scope, reason: str) -> Expression:
        result = self.quantity(node, scope)
        if result.dimension is None:
            advice = "use a vector or leave it out"
            if self.declared.is_bare:
                names = dict.fromkeys(part.name for part, _ in syntax.walk(node) if isinstance(part, syntax.Name))
                vectors = " ".join(f"signal {name}[2]" for name in names)
                advice = f"say that it is a vector, '{vectors} spec: ...'" if names else advice
            raise self.error(node, f"found a scalar; expected a vector: {reason}; {advice}")
        return result

    def same(self, nodes: tuple[Node, ...], scope: Scope, what: str) -> list[Expression]:
        """The values of several trees that must be of one kind."""
        values = [self.amount(node, scope) for node in nodes]
        for node, value in zip(nodes[1:], values[1:], strict=True):
            if (value.dimension, value.is_duration) != (values[0].dimension, values[0].is_duration):
                raise self.error(
                    node,
                    f"found {_shape(value)}; expected {_shape(values[0])}, as '{nodes[0]}' is; {what}",
                )
        return values

    def fold(self, node: Node, name: str, *args: int) -> int:
        """Add an arithmetic operation that may fail, remembering its place."""
        try:
            number = self.graph.add(name, *args)
        except FloatingPointError:
            raise self.error(node, f"'{node}' is a constant without a finite value; correct its numbers") from None
        self.places.setdefault(number, Predicate(str(node), node.span))
        return number

    def _arithmetic(self, node: syntax.Arithmetic, scope: Scope) -> Expression:
        name = _ARITHMETIC[node.operator]
        if node.operator in "+-":
            left, right = self.same((node.left, node.right), scope, "add and subtract like to like")
            is_duration = left.is_duration
        else:
            left, right = self.amount(node.left, scope), self.amount(node.right, scope)
            is_duration = left.is_duration != right.is_duration
            if (left.is_duration and right.is_duration and node.operator != "/") or (
                is_duration and (node.operator == "**" or (node.operator == "/" and right.is_duration))
            ):
                raise self.error(
                    node, f"'{node}' is neither a duration nor a number; expected one of them; correct the units"
                )
            if right.dimension is not None and (left.dimension is not None or node.operator != "*"):
                raise self.error(
                    node.right,
                    f"found {_shape(right)}; expected a scalar after {node.operator}; "
                    "work on components (.x, [0]) or use norm(...)",
                )
            if left.dimension is not None and node.operator == "**":
                raise self.error(node.left, f"found {_shape(left)}; expected a scalar before **; use norm(...)")
        divisor = self.graph.ops[right.components[0]]
        if node.operator == "/" and divisor.name == "constant" and divisor.data == (0.0,):
            raise self.error(node.right, f"'{node.right}' is zero; expected a divisor other than zero; correct it")
        dimension = left.dimension if left.dimension is not None else right.dimension
        lefts = left.components * (dimension or 1) if left.dimension is None else left.components
        rights = right.components * (dimension or 1) if right.dimension is None else right.components
        components = tuple(self.fold(node, name, a, b) for a, b in zip(lefts, rights, strict=True))
        return Expression(components, dimension, is_duration)

    def _call(self, node: syntax.Call, scope: Scope) -> Expression | Truth:
        name, arguments = node.function, node.arguments
        if name in self.functions:
            return self._call_of(self.functions[name], node, scope)
        if name not in FUNCTIONS or name in self.declared.names:
            what = "is no function" if name in self.declared.names else "unknown function"
            near = nearest(name, [*FUNCTIONS, *self.functions]).removeprefix("; ")
            advice = elsewhere(name) or (near if near.startswith("did") else "write it with these")
            raise self.error(node, f"{what}: '{name}'; expected one of {', '.join(FUNCTIONS)}; {advice}")
        fewest, most = FUNCTIONS[name]
        if not fewest <= len(arguments) <= most:
            plural = "s" * (fewest > 1)
            raise self.error(
                node,
                f"'{name}' got {len(arguments)} argument{'s' * (len(arguments) != 1)}; "
                f"expected {fewest} argument{plural}; add or delete some",
            )
        match name:
            case "previous":
                before = self.evaluate(arguments[0], scope)
                if isinstance(before, Truth):
                    return previous(self.graph, before, 1, False)
                (before,) = (self.quantity(a, scope) for a in arguments)
                return replace(before, components=tuple(map(self._lag, before.components)))
            case "rise" | "fall":
                return change(self.graph, self.truth(arguments[0], scope), name == "rise")
            case "holds":
                condition = self.truth(arguments[0], scope)
                number = self.graph.add("holds", condition.node)
                self.conditions[number] = condition
                return Truth(number, predicate=Predicate(str(_as_read(node, scope)), node.span))
            case "ball" | "box":
                return self._region(node, scope)
            case "clip":
                x, low, high = (self.scalar(a, scope) for a in arguments)
                return Expression((self.fold(node, "maximum", self.fold(node, "minimum", x, high), low),))
            case "dot":
                a, b = self.same(arguments, scope, "a product is of two vectors of one dimension")
                for argument in arguments if a.dimension is None else ():
                    self.vector(argument, scope, "the product of two scalars is written a * b")
                products = [self.fold(node, "multiply", *pair) for pair in zip(a.components, b.components, strict=True)]
                total, *rest = products
                for product in rest:
                    total = self.fold(node, "add", total, product)
                return Expression((total,))
            case "norm":
                vector = self.vector(arguments[0], scope, "a norm is taken of a vector, of a scalar use abs(...)")
                return Expression((self.fold(node, "norm", *vector.components),))
            case "distance":
                return Expression((self._distance(node, scope, arguments),))
            case "min" | "max":
                op = name + "imum"
                if len(arguments) > 1:
                    return Expression((self.fold(node, op, *(self.scalar(a, scope) for a in arguments)),))
                vector = self.vector(arguments[0], scope, f"{name} takes several scalars or one vector")
                return Expression((self.fold(node, op, *vector.components),))
            case _:
                return Expression((self.fold(node, _OF_SCALARS[name], *(self.scalar(a, scope) for a in arguments)),))

    def _lag(self, component: int) -> int:
        return component if self.graph.ops[component].name == "constant" else self.graph.add("lag", component)

    def _call_of(self, function: syntax.Definition, node: syntax.Call, scope: Scope) -> Expression | Truth:
        """A call of a function that the text defines: its body, with the arguments in the place of the parameters."""
        count, expected = len(node.arguments), len(function.parameters)
        if count != expected:
            raise self.error(
                node,
                f"'{function.name}' got {count} argument{'s' * (count != 1)}; expected {expected}: "
                f"{', '.join(function.parameters)}; add or delete some",
            )
        arguments = [Bound(self.evaluate(a, scope), _as_read(a, scope)) for a in node.arguments]
        title = str(_as_read(node, scope))
        if title in self.called:
            return self.called[title]
        within, own = self.within, syntax.depth(function.body)
        if len(self.called) >= MAX_CALLS or self.depth + own > MAX_DEPTH:
            raise self.error(
                node,
                f"'{title[:80]}' is one of more than {MAX_CALLS} calls, or nested more than {MAX_DEPTH} operators "
                "deep; expected less; name parts of it with 'def' or 'let'",
            )
        self.depth += own
        self.within = title if function.keyword == "def" else within
        inside: Scope = dict(zip(function.parameters, arguments, strict=True))
        try:
            read = self.truth if function.keyword == "def" else self.amount
            result = read(function.body, inside)
        except SpecError as mistake:
            if " (read as '" in mistake.problem:
                raise
            raise SpecError(
                self.source, mistake.span, f"{mistake.problem} (read as '{title}', line {node.span.line})"
            ) from None
        self.depth, self.within = self.depth - own, within
        if isinstance(result, Truth) and result.name is None:
            result = replace(result, name=title)
        self.called[title] = result
        return result

    def _distance(self, node: Node, scope: Scope, points: tuple[Node, ...]) -> int:
        a, b = self.same(points, scope, "a distance is between points of one space")
        differences = [self.fold(node, "subtract", p, q) for p, q in zip(a.components, b.components, strict=True)]
        number = self.fold(node, "absolute" if a.dimension is None else "norm", *differences)
        for point, centre_node, centre in ((points[0], points[1], b), (points[1], points[0], a)):
            if a.dimension is not None and self._is_fixed(centre):
                self.distances[number] = _as_read(point, scope), self.fixed(centre_node, centre, "centre")
        return number

    # Regions

    def _is_fixed(self, value: Expression) -> bool:
        return all(self.graph.ops[c].name == "constant" for c in value.components)

    def fixed(self, node: Node, value: Expression, what: str) -> tuple[float, ...]:
        """The numbers of a quantity that holds no signal."""
        if not self._is_fixed(value):
            raise self.error(
                node,
                f"found a signal; expected constants, a {what} is the same at all times; write numbers or constants",
            )
        return tuple(self.graph.constant(c) for c in value.components)

    def _region(self, node: syntax.Call, scope: Scope) -> Truth:
        point, *rest = node.arguments
        if node.function == "ball":
            centre_node, radius_node = rest
            values = self.same((point, centre_node), scope, "a ball and its points lie in one space")
            radius = Expression((self.scalar(radius_node, scope),))
            (size,) = self.fixed(radius_node, radius, "radius")
            if size <= 0:
                raise self.error(radius_node, f"the radius is {size:g}; expected a positive number; correct it")
            far = self._distance(node, scope, (point, centre_node))
            truth = self._predicate(node, self.fold(node, "subtract", radius.components[0], far), scope)
            if values[0].dimension is not None and self._is_fixed(values[1]):
                centre = self.fixed(centre_node, values[1], "ball")
                self._remember(truth, _as_read(point, scope), "ball", True, centre=centre, radius=size)
            return truth
        x, low, high = self.same((point, *rest), scope, "a box and its points lie in one space")
        if is_still := self._is_fixed(low) and self._is_fixed(high):
            lower, upper = self.fixed(rest[0], low, "box"), self.fixed(rest[1], high, "box")
            for a, b in zip(lower, upper, strict=True):
                if not a < b:
                    raise self.error(
                        rest[0],
                        f"the box is empty: a lower bound is {a:g}, its upper {b:g}; "
                        "expected lower < upper in every component; swap or correct them",
                    )
        faces = [
            self.fold(node, "subtract", *pair)
            for c, a, b in zip(x.components, low.components, high.components, strict=True)
            for pair in ((c, a), (b, c))
        ]
        truth = self._predicate(node, self.fold(node, "minimum", *faces), scope)
        if x.dimension is not None and is_still:
            self._remember(truth, _as_read(point, scope), "box", True, lower=lower, upper=upper)
        return truth

    def _remember(self, predicate: Truth, point: Node, kind: str, inside: bool, **shape: Any) -> None:
        signal = str(point) if str(point) in self.declared.signals else None
        self.regions.append((Region(self.within, kind, signal, inside, **shape), predicate.node))

    # Formulas

    def truth(self, node: Node, scope: Scope) -> Truth:
        result = self.evaluate(node, scope)
        if isinstance(result, Expression):
            advice = f"compare it, as in {node} > 0.5 if 1 says that it is true"
            if isinstance(node, syntax.Name) and node.name in self.declared.signals:
                advice += f", or declare it so, as in 'signal {node.name}: bool'"
            if result.dimension is not None:
                advice = f"compare a component or the length, as in norm({node}) < 1"
            raise self.error(node, f"found {_shape(result)}; expected a formula; {elsewhere(str(node)) or advice}")
        return result if result.span else replace(result, span=node.span)

    def _predicate(self, node: Node, number: int, scope: Scope) -> Truth:
        if self.graph.ops[number].name == "constant":
            raise self.error(node, f"'{node}' holds no signal, its value never changes; expected a signal; correct it")
        return Truth(number, predicate=Predicate(str(_as_read(node, scope)), node.span))

    def _comparison(self, node: syntax.Comparison, scope: Scope) -> Truth:
        values = [self.scalar(operand, scope) for operand in node.operands]
        links = []
        for i, operator in enumerate(node.operators):
            small, large = (i, i + 1) if operator[0] == "<" else (i + 1, i)
            link = syntax.Comparison(
                node.operands[i : i + 2],
                (operator,),
                span=node.operands[i].span.to(node.operands[i + 1].span),
            )
            links.append(self._predicate(link, self.fold(link, "subtract", values[large], values[small]), scope))
            for near, far in ((small, large), (large, small)):
                if values[near] in self.distances and self.graph.ops[values[far]].name == "constant":
                    point, centre = self.distances[values[near]]
                    radius = self.graph.constant(values[far])
                    if radius > 0:
                        self._remember(links[-1], point, "ball", near == small, centre=centre, radius=radius)
        return links[0] if len(links) == 1 else both(self.graph, *links)

    def _marked(self, interval: syntax.Interval | None, mark: str = "") -> bool:
        """Whether the interval has the one mark that its operator may have."""
        if interval is None or not interval.mark:
            return False
        if interval.mark != mark:
            bounds = f"{interval.lower}, {interval.upper}"
            advice = {
                "?": f"a window that the end cuts counts against it unless you write [{bounds}?]",
                "!": f"a window that the end cuts counts for it unless you write [{bounds}!]",
                "": "F and U alone may have '?', G and R '!'",
            }[mark]
            raise self.error(interval, f"found the mark '{interval.mark}'; expected none here; delete it: {advice}")
        return True

    def _formula(self, node: Node, scope: Scope) -> Truth:
        def of(child: Node) -> Truth:
            return self.truth(child, scope)

        graph = self.graph
        match node:
            case syntax.Comparison():
                return self._comparison(node, scope)
            case syntax.Not(p):
                return negation(graph, of(p))
            case syntax.And(operands):
                return both(graph, *map(of, operands))
            case syntax.Or(operands):
                return either(graph, *map(of, operands))
            case syntax.Implies(p, q):
                return implication(graph, of(p), of(q))
            case syntax.Iff(p, q):
                a, b = of(p), of(q)
                return both(graph, implication(graph, a, b), implication(graph, b, a))
            case syntax.Xor(p, q):
                a, b = of(p), of(q)
                return either(graph, both(graph, a, negation(graph, b)), both(graph, b, negation(graph, a)))
            case syntax.Next(p, strong):
                return operation(graph, "next", of(p), data=(1, strong))
            case syntax.Always(p, interval):
                window = self._window(interval, scope)
                always = reduced(graph, "always", of(p), window)
                if self._marked(interval, "!"):
                    return both(graph, always, negation(graph, cut(graph, window)))
                return always
            case syntax.Eventually(p, interval):
                window = self._window(interval, scope)
                eventually = reduced(graph, "eventually", of(p), window)
                return either(graph, eventually, cut(graph, window)) if self._marked(interval, "?") else eventually
            case syntax.Until(p, q, interval):
                a, b, window = of(p), of(q), self._window(interval, scope)
                return (until_or_cut if self._marked(interval, "?") else until)(graph, a, b, window)
            case syntax.Release(p, q, interval):
                a, b = negation(graph, of(p)), negation(graph, of(q))
                window = self._window(interval, scope)
                dual = until_or_cut if self._marked(interval, "!") else until
                return negation(graph, dual(graph, a, b, window))
            case syntax.WeakUntil(p, q, interval):
                self._marked(interval)
                return weak_until(graph, of(p), of(q), self._window(interval, scope))
            case syntax.Then(p, q, interval):
                self._marked(interval)
                return then(graph, of(p), of(q), self._window(interval, scope))
            case syntax.Previous(p):
                return previous(graph, of(p), 1, True)
            case syntax.Once(p, interval):
                self._marked(interval)
                return looking_back(graph, "once", of(p), self._window(interval, scope))
            case syntax.Historically(p, interval):
                self._marked(interval)
                return looking_back(graph, "historically", of(p), self._window(interval, scope))
            case syntax.Since(p, q, interval):
                self._marked(interval)
                return since(graph, of(p), of(q), self._window(interval, scope))
            case syntax.ForEach(quantifier, variable, labels, body):
                check_binding(self.source, node.span, variable, labels, self.declared.names)
                if variable in scope:
                    raise self.error(
                        node,
                        f"the variable '{variable}' is already bound around this; expected a new name; choose another",
                    )
                bodies = [self.truth(body, {**scope, variable: label}) for label in labels]
                return (both if quantifier == "all" else either)(graph, *bodies)
            case _:
                raise TypeError(f"no meaning for {type(node).__name__}")

    def _window(self, interval: syntax.Interval | None, scope: Scope) -> Window:
        """The bounds in steps; None where the window is the whole slice."""
        if interval is None:
            return None
        lower, lower_text = self._bound(interval.lower, scope)
        if isinstance(interval.upper, syntax.Infinity):
            return (lower, FOREVER) if lower > 0 else None
        upper, upper_text = self._bound(interval.upper, scope)
        if 0 not in (lower, upper) and lower_text.endswith("s") != upper_text.endswith("s"):
            raise self.error(
                interval,
                f"one bound is in steps and one in seconds: {lower_text}, {upper_text}; expected both alike; "
                "write both with their unit",
            )
        if lower > upper:
            raise self.error(
                interval,
                f"the interval is reversed: {lower_text} is greater than {upper_text}; expected [small, large]; "
                "swap them",
            )
        return lower, upper

    def _bound(self, node: Node, scope: Scope) -> tuple[int, str]:
        """A bound in steps, and as a message shows it."""
        bound = self.amount(node, scope)
        if bound.dimension is not None:
            raise self.error(
                node, f"found {_shape(bound)}; expected a scalar; a bound is one number of steps or seconds"
            )
        (value,) = self.fixed(node, bound, "bound")
        try:
            if bound.is_duration:
                self.timed = self.timed or node.span
                return samples_in(value, self.declared.period), f"{syntax.number_text(value)} s"
            steps = steps_of(value)
        except ValueError as mistake:
            raise self.error(node, str(mistake)) from None
        return steps, str(steps)


def _as_read(node: Node, scope: Scope) -> Node:
    """A tree with labels in the place of their variables, and arguments in that of parameters."""
    if not scope:
        return node
    names = {name: bound.node for name, bound in scope.items() if isinstance(bound, Bound)}
    return syntax.replaced(node, names, {name: label for name, label in scope.items() if isinstance(label, str)})


def _title(name: str, label: str | None) -> str:
    return name if label is None else f"{name}[{label}]"


def _shape(value: Expression) -> str:
    if value.is_duration:
        return "a duration"
    return "a scalar" if value.dimension is None else f"a vector of {value.dimension}"
