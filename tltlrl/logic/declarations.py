"""Reads the declarations of a document, before any formula.

Every name is declared once. Families get their labels, constants their overrides. In a bare formula, names are signals.
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import TypeGuard

import numpy as np

from tltlrl.errors import nearest
from tltlrl.logic import syntax
from tltlrl.logic.errors import Source, Span, SpecError
from tltlrl.logic.syntax import Node

Value = float | tuple[float, ...]
MAX_DIMENSION = 1000  # of a signal: each component needs a node of its own

# Those that no name can hide; the others are names where the text declares them.
RESERVED = {"abs", "sqrt", "exp", "sin", "cos", "min", "max", "norm", "distance", "ball", "box"}
NUMBERS = {"pi": math.pi}
# name -> fewest and most arguments
FUNCTIONS = {
    "abs": (1, 1),
    "sqrt": (1, 1),
    "exp": (1, 1),
    "sin": (1, 1),
    "cos": (1, 1),
    "tan": (1, 1),
    "asin": (1, 1),
    "acos": (1, 1),
    "atan2": (2, 2),
    "wrap": (1, 1),
    "log": (1, 1),
    "mod": (2, 2),
    "floor": (1, 1),
    "sign": (1, 1),
    "clip": (3, 3),
    "dot": (2, 2),
    "previous": (1, 1),
    "rise": (1, 1),
    "fall": (1, 1),
    "holds": (1, 1),
    "min": (1, math.inf),
    "max": (1, math.inf),
    "norm": (1, 1),
    "distance": (2, 2),
    "ball": (3, 3),
    "box": (3, 3),
}


@dataclass(frozen=True, slots=True)
class Declarations:
    """The names of a document, before any formula is read.

    `names` are all declared names; `families` are the labels of the names that have members; `durations` are the
    constants (name and label) in seconds; `document` is the given document with the effective constants and period.
    `is_bare` says that the document declares nothing, so that its names are signals.
    """

    names: tuple[str, ...]
    signals: dict[str, int | None]
    members: dict[str, tuple[str, str | None]]  # signal `ped[1]` => the name of its family and its label
    signal_spans: dict[str, Span]
    booleans: frozenset[str]  # names of the signals that are true or false
    families: dict[str, tuple[str, ...]]
    constants: dict[str, Value | dict[str, Value]]
    durations: frozenset[tuple[str, str | None]]
    period: float | None  # s
    document: syntax.Document
    is_bare: bool


def declare(
    source: Source, document: syntax.Document, overrides: Mapping[str, object] | None, period: float | None
) -> Declarations:
    """Reads the declarations, overrides constants and finds the sampling period, s.

    Raises:
      SpecError: at the first declaration that is wrong.
    """
    names, labels = _names(source, document)
    families = {name: tuple(found) for name, found in labels.items()}
    for d in document.declarations:
        if isinstance(d, syntax.Definition | syntax.Signal) and d.variable:
            check_binding(source, d.span, d.variable, d.labels, names)
        for name in d.parameters if isinstance(d, syntax.Definition) else ():
            if name in names or name in RESERVED:
                raise SpecError(
                    source, d.span, f"the parameter '{name}' has another meaning here; expected a new name; rename it"
                )
    own = [
        (d, label, d.name if label is None else f"{d.name}[{label}]")
        for d in document.declarations
        if isinstance(d, syntax.Signal)
        for label in d.labels or (None,)
    ]
    signals, spans = {title: d.dimension for d, _, title in own}, {title: d.span for d, _, title in own}
    members = {title: (d.name, label) for d, label, title in own}
    if document.is_bare:
        signals, spans = _inferred_signals(document.formula)
        members = {name: (name, None) for name in signals}
        for name in sorted(FUNCTIONS.keys() & signals.keys()):
            raise SpecError(source, spans[name], f"'{name}' is a function; expected its arguments; write {name}(...)")
    constants = _effective_constants(source, document, families, {} if overrides is None else overrides)
    period = _period(source, document, period)
    settled = _with_period(_with_constants(document, constants), period)
    durations = frozenset(
        (d.name, d.label) for d in document.declarations if isinstance(d, syntax.Constant) and d.is_duration
    )
    booleans = frozenset(title for d, _, title in own if d.is_boolean)
    return Declarations(
        names, signals, members, spans, booleans, families, constants, durations, period, settled, document.is_bare
    )


def _period(source: Source, document: syntax.Document, given: float | None) -> float | None:
    """The time between two samples, s, from the text or the caller, which must not disagree."""
    own = [d for d in document.declarations if isinstance(d, syntax.Period)]
    for d in own:
        if not 0 < d.seconds < math.inf:
            raise SpecError(source, d.span, f"the period is {d.seconds:g} s; expected more than 0; correct it")
    if len(own) > 1:
        raise SpecError(source, own[1].span, "the period is given twice; expected once; delete one")
    if given is None:
        return own[0].seconds if own else None
    if not _is_number(given) or given <= 0:
        span = own[0].span if own else document.span
        raise SpecError(source, span, f"the period given is {given!r}; expected seconds, more than 0; correct it")
    if own and not math.isclose(own[0].seconds, given, rel_tol=1e-6):
        raise SpecError(
            source,
            own[0].span,
            f"the samples are {given:.12g} s apart, but the spec says {own[0].seconds:.12g} s; expected one period; "
            "correct or delete this line",
        )
    return own[0].seconds if own else float(given)


def _with_period(document: syntax.Document, period: float | None) -> syntax.Document:
    if period is None or any(isinstance(d, syntax.Period) for d in document.declarations):
        return document
    return replace(document, declarations=(syntax.Period(period), *document.declarations))


def check_binding(source: Source, span: Span, variable: str, labels: tuple[str, ...], names: tuple[str, ...]) -> None:
    """Checks that a family or quantifier may use this variable for these labels.

    Raises:
      SpecError: if it may not.
    """
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise SpecError(source, span, f"the label '{twice}' is listed twice; expected once; delete one")
    if variable in names or variable in labels or variable in RESERVED:
        raise SpecError(
            source,
            span,
            f"the variable '{variable}' has another meaning here; expected a new name; choose another variable",
        )


def _names(source: Source, document: syntax.Document) -> tuple[tuple[str, ...], dict[str, list[str]]]:
    """Every declared name, and the labels of every family."""
    declared: dict[str, syntax.Signal | syntax.Constant | syntax.Definition] = {}
    labels: dict[str, list[str]] = {}
    for d in document.declarations:
        if isinstance(d, syntax.Period):
            continue
        first = declared.get(d.name)
        if d.name in RESERVED:
            raise SpecError(
                source, d.span, f"'{d.name}' is a function of the language; expected a new name; choose another"
            )
        if first is not None and not (isinstance(d, syntax.Constant) and isinstance(first, syntax.Constant)):
            raise SpecError(
                source,
                d.span,
                f"'{d.name}' is declared twice, first on line {first.span.line}; expected once; rename one",
            )
        if isinstance(d, syntax.Constant):
            if first is not None and (d.label is None or d.name not in labels or d.label in labels[d.name]):
                what = d.name if d.label is None else f"{d.name}[{d.label}]"
                raise SpecError(
                    source,
                    d.span,
                    f"'{what}' is declared twice, first on line {first.span.line}; expected once; delete one",
                )
            if d.label is not None:
                labels.setdefault(d.name, []).append(d.label)
            assert not isinstance(d.value, Node)
            if not all(map(math.isfinite, d.value if isinstance(d.value, tuple) else (d.value,))):
                raise SpecError(
                    source,
                    d.span,
                    f"the value of '{d.name}' is too large for a float; expected a finite number; write one",
                )
        if isinstance(d, syntax.Signal) and d.dimension is not None and not 1 <= d.dimension <= MAX_DIMENSION:
            raise SpecError(
                source,
                d.span,
                f"this is no dimension; expected a whole number from 1 to {MAX_DIMENSION}; write for instance ee[2]",
            )
        if isinstance(d, syntax.Definition | syntax.Signal) and d.variable:
            labels[d.name] = list(d.labels)
        declared.setdefault(d.name, d)
    return tuple(declared), labels


def _inferred_signals(formula: Node) -> tuple[dict[str, int | None], dict[str, Span]]:
    """The signals of a bare formula, its free names: vectors where the formula combines them with one, else scalars."""
    names: dict[str, Span] = {}
    alike: list[tuple[Node, ...]] = []  # terms of one dimension
    for node, _ in syntax.walk(formula):
        match node:
            case syntax.Name(name):
                if name not in NUMBERS:
                    names.setdefault(name, node.span)
            case syntax.Call("ball", (point, centre, _)):  # its radius is a scalar
                alike.append((point, centre))
            case syntax.Call("distance" | "box" | "dot", terms):
                alike.append(terms)
            case syntax.Arithmetic("+" | "-", a, b):
                alike.append((a, b))
    told_by: dict[str, list[tuple[Node, ...]]] = {name: [] for name in names}
    for terms in alike:
        for term in terms:
            for node, _ in syntax.walk(term):
                if isinstance(node, syntax.Name) and node.name in told_by:
                    told_by[node.name].append(terms)
    known: dict[str, int] = {}
    pending = deque(alike)
    while pending:
        terms = pending.popleft()
        dimension = next((d for t in terms if (d := _dimension(t, known)) is not None), None)
        if dimension is not None:
            found = set().union(*map(_names_of_dimension, terms)) - known.keys()
            known |= dict.fromkeys(found, dimension)
            for name in found:
                pending.extend(told_by[name])
    return {name: known.get(name) for name in names}, names


def _dimension(node: Node, known: Mapping[str, int]) -> int | None:
    """The dimension of an expression in a bare formula, as far as its form shows it."""
    parts: Iterator[Node] = iter(())
    match node:
        case syntax.Vector(items):
            return len(items)
        case syntax.Name(name):
            return known.get(name)
        case syntax.Negative(a) | syntax.Call("previous", (a,)):
            parts = iter((a,))
        case syntax.Arithmetic(_, a, b):
            parts = iter((a, b))
    return next((d for part in parts if (d := _dimension(part, known)) is not None), None)


def _names_of_dimension(node: Node) -> set[str]:
    """The names that must have the dimension that an expression has."""
    match node:
        case syntax.Name(name):
            return {name}
        case syntax.Negative(a) | syntax.Call("previous", (a,)) | syntax.Arithmetic("/", a, _):
            return _names_of_dimension(a)
        case syntax.Arithmetic("+" | "-", a, b):
            return _names_of_dimension(a) | _names_of_dimension(b)
        case syntax.Arithmetic("*", a, b) if isinstance(a, syntax.Number):
            return _names_of_dimension(b)
        case syntax.Arithmetic("*", a, b) if isinstance(b, syntax.Number):
            return _names_of_dimension(a)
    return set()


def _effective_constants(
    source: Source,
    document: syntax.Document,
    families: Mapping[str, tuple[str, ...]],
    overrides: Mapping[str, object],
) -> dict[str, Value | dict[str, Value]]:
    own = [d for d in document.declarations if isinstance(d, syntax.Constant)]
    names = list(dict.fromkeys(d.name for d in own))
    if not isinstance(overrides, Mapping):
        raise SpecError(
            source,
            own[0].span if own else document.span,
            f"the overrides are of type {type(overrides).__name__}; expected a mapping from constant to value; "
            "pass for instance {'goal_radius': 0.3}",
        )
    for name in overrides:
        if name not in names:
            span = own[0].span if own else document.span
            raise SpecError(
                source,
                span,
                f"an override gives the constant '{name}', which this spec lacks; expected one of "
                f"its own{nearest(name, names) or '; there are none'}",
            )
    for name, given in overrides.items():
        d = next(d for d in own if d.name == name)
        if name in families:
            if not isinstance(given, Mapping):
                first = families[name][0]
                assert not isinstance(d.value, Node)
                raise SpecError(
                    source,
                    d.span,
                    f"'{name}' is a family of constants, and its override is {_shown(given)}; "
                    f"expected a mapping, such as {{'{first}': {syntax.value_text(d.value)}}}; write one",
                )
            for label in given:
                if str(label) not in families[name]:
                    raise SpecError(
                        source,
                        d.span,
                        f"an override gives '{name}[{label}]', which this spec lacks; expected one of its own"
                        f"{nearest(label, families[name])}",
                    )
    constants: dict[str, Value | dict[str, Value]] = {}
    for d in own:
        given = overrides.get(d.name, d.value)
        if d.label is None:
            constants[d.name] = _value(source, d, given)
        else:
            family = constants.setdefault(d.name, {})
            assert isinstance(family, dict)
            by_label = {str(k): v for k, v in given.items()} if isinstance(given, Mapping) else {}
            family[d.label] = _value(source, d, by_label.get(d.label, d.value))
    return constants


def _value(source: Source, d: syntax.Constant, given: object) -> Value:
    """An override as floats, of the same dimension as the value it replaces."""
    assert not isinstance(d.value, Node)
    plain = given.tolist() if isinstance(given, np.ndarray) else given
    if isinstance(d.value, tuple):
        if isinstance(plain, list | tuple) and len(plain) == len(d.value) and all(map(_is_number, plain)):
            return tuple(map(float, plain))
    elif _is_number(plain):
        return float(plain)
    what = d.name if d.label is None else f"{d.name}[{d.label}]"
    expected = f"a vector of {len(d.value)} numbers" if isinstance(d.value, tuple) else "a number"
    advice = "correct the override"
    if isinstance(d.value, tuple) and isinstance(given, Mapping):
        components = ",".join(map(syntax.number_text, d.value))
        advice = f"give all of it at once, as {d.name if d.label is None else f'{d.name}.{d.label}'}=[{components}]"
    raise SpecError(
        source,
        d.span,
        f"the override of '{what}' is {_shown(given)}; expected {expected}, finite, as the spec's own value; {advice}",
    )


def overridden(source: Source, d: syntax.Constant, overrides: Mapping[str, object]) -> Value:
    """The value of a constant: its override if there is one, otherwise its own value.

    Raises:
      SpecError: if the override is of another kind than the constant.
    """
    assert not isinstance(d.value, Node)
    given = overrides.get(d.name, d.value) if isinstance(overrides, Mapping) else d.value
    if d.label is not None and isinstance(given, Mapping):
        given = {str(k): v for k, v in given.items()}.get(d.label, d.value)
    return _value(source, d, given)


def _is_number(given: object) -> TypeGuard[float]:
    """Whether a value is a finite real number; true and false are not numbers."""
    try:
        return not isinstance(given, bool) and isinstance(given, Real) and math.isfinite(given)
    except OverflowError:  # an integer beyond the floats
        return False


def _shown(given: object) -> str:
    try:
        return repr(given)
    except ValueError:  # Python writes no integers of thousands of digits
        return "a number of thousands of digits"


def _with_constants(document: syntax.Document, constants: Mapping[str, Value | dict[str, Value]]) -> syntax.Document:
    def effective(d: syntax.Declaration) -> syntax.Declaration:
        if not isinstance(d, syntax.Constant):
            return d
        value = constants[d.name]
        if isinstance(value, dict):
            assert d.label is not None
            value = value[d.label]
        return replace(d, value=value)

    return replace(document, declarations=tuple(map(effective, document.declarations)))
