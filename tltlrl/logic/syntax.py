"""The syntax tree of a spec, as it was written, and its text.

`str(tree)` parses back to an equal tree; equality ignores where in the text a node stood. Numbers and formulas share
one kind of tree, because `(x` may begin either; `tltlrl.logic.resolve` tells them apart.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from tltlrl.logic.errors import NOWHERE, Span


@dataclass(frozen=True, slots=True)
class Node:
    """Anything with a place in the text."""

    span: Span = field(default=NOWHERE, compare=False, repr=False, kw_only=True)

    def __str__(self) -> str:
        return text(self)


@dataclass(frozen=True, slots=True)
class Number(Node):
    """An unsigned number."""

    value: float


@dataclass(frozen=True, slots=True)
class Duration(Node):
    """`1.5 s`, `20 ms`, `2 min`."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Boolean(Node):
    """`true`, `false`."""

    value: bool


@dataclass(frozen=True, slots=True)
class Vector(Node):
    """`(a, b, ...)`, at least two scalars."""

    items: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Name(Node):
    """A signal, constant or definition."""

    name: str


@dataclass(frozen=True, slots=True)
class Index(Node):
    """`goal[r]`: a member of a family; `ee[0]`: a component of a vector."""

    base: Node
    label: str


@dataclass(frozen=True, slots=True)
class Component(Node):
    """`ee.x`, `ee.y`, `ee.z`."""

    base: Node
    axis: str


@dataclass(frozen=True, slots=True)
class Negative(Node):
    """`-a`."""

    operand: Node


@dataclass(frozen=True, slots=True)
class Arithmetic(Node):
    """`a + b`, `a - b`, `a * b`, `a / b`, `a ** b`."""

    operator: str
    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Call(Node):
    """`norm(a)`, `distance(a, b)`, `ball(x, centre, radius)`, ..."""

    function: str
    arguments: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Comparison(Node):
    """`a < b`, or a chain `a < x < b`, which is the conjunction of its links."""

    operands: tuple[Node, ...]
    operators: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Not(Node):
    """`!p`."""

    operand: Node


@dataclass(frozen=True, slots=True)
class And(Node):
    """`p & q & ...`."""

    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Or(Node):
    """`p | q | ...`."""

    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Implies(Node):
    """`p => q`."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Iff(Node):
    """`p <=> q`."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Xor(Node):
    """`p xor q`: not both and not neither."""

    left: Node
    right: Node


@dataclass(frozen=True, slots=True)
class Next(Node):
    """`X p`, or `X[!] p` when strong."""

    operand: Node
    strong: bool = False


@dataclass(frozen=True, slots=True)
class Infinity(Node):
    """`inf`, the upper bound of an interval without end."""


@dataclass(frozen=True, slots=True)
class Interval(Node):
    """`[a, b]` in steps or seconds; `[a, b?]` and `[a, b!]` say the value of a window that the end cuts."""

    lower: Node
    upper: Node
    mark: str = ""


@dataclass(frozen=True, slots=True)
class Always(Node):
    """`G p`, `G[a,b] p`."""

    operand: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Eventually(Node):
    """`F p`, `F[a,b] p`."""

    operand: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Until(Node):
    """`p U q`, `p U[a,b] q`."""

    left: Node
    right: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Release(Node):
    """`p R q`, `p R[a,b] q`: the dual of U."""

    left: Node
    right: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class WeakUntil(Node):
    """`p W q`: `(p U q) | G p`; `p W[a,b] q`: `(p U[a,b] q) | G[0,b] p`."""

    left: Node
    right: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Then(Node):
    """`p T q`: first p, later q; `p T[a,b] q`."""

    left: Node
    right: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Previous(Node):
    """`previous[!] p`, the strong one; the weak one, `previous p`, is the call `previous(p)`."""

    operand: Node


@dataclass(frozen=True, slots=True)
class Once(Node):
    """`once p`, `once[a,b] p`."""

    operand: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Historically(Node):
    """`historically p`, `historically[a,b] p`."""

    operand: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class Since(Node):
    """`p since q`, `p since[a,b] q`."""

    left: Node
    right: Node
    interval: Interval | None = None


@dataclass(frozen=True, slots=True)
class ForEach(Node):
    """`all i in r, g, b: p` (a conjunction) or `any i in r, g, b: p` (a disjunction)."""

    quantifier: str
    variable: str
    labels: tuple[str, ...]
    body: Node


@dataclass(frozen=True, slots=True)
class Signal(Node):
    """`signal ee[2]`; a scalar has dimension None. `signal pressed: bool` is true or false."""

    name: str
    dimension: int | None
    is_boolean: bool = False
    variable: str | None = None
    labels: tuple[str, ...] = ()  # of a family: `signal ped[i in 1..5][2]`


@dataclass(frozen=True, slots=True)
class Constant(Node):
    """`const goal = (1, 2)`, or a member of a family: `const goal[r] = (1, 2)`; a value that is computed is a tree."""

    name: str
    label: str | None
    value: float | tuple[float, ...] | Node
    is_duration: bool = False  # in seconds


@dataclass(frozen=True, slots=True)
class Definition(Node):
    """`let d = ...` (a number) or `def p: ...` (a formula).

    With a variable it is a family, `def at[i in r, g]: ...`; with parameters, a function.
    """

    keyword: str
    name: str
    variable: str | None
    labels: tuple[str, ...]
    body: Node
    parameters: tuple[str, ...] = ()  # `def near(p, r): ...`


@dataclass(frozen=True, slots=True)
class Period(Node):
    """`period 0.05 s`: the time between two samples."""

    seconds: float


Declaration = Signal | Constant | Definition | Period


@dataclass(frozen=True, slots=True)
class Document(Node):
    """Declarations in the order written, and the spec's formula. A bare document declares at most its period."""

    declarations: tuple[Declaration, ...]
    formula: Node
    is_bare: bool = False


def children(node: Node) -> tuple[Node, ...]:
    """The nodes directly below."""
    match node:
        case Vector(items) | And(items) | Or(items) | Call(_, items) | Comparison(items, _):
            return items
        case Index(a, _) | Component(a, _) | Negative(a) | Not(a) | Next(a, _) | Previous(a) | ForEach(_, _, _, a):
            return (a,)
        case Always(a, interval) | Eventually(a, interval) | Once(a, interval) | Historically(a, interval):
            return (a, *(() if interval is None else (interval,)))
        case (
            Until(a, b, interval)
            | Release(a, b, interval)
            | WeakUntil(a, b, interval)
            | Then(a, b, interval)
            | Since(a, b, interval)
        ):
            return (a, b, *(() if interval is None else (interval,)))
        case Arithmetic(_, a, b) | Implies(a, b) | Iff(a, b) | Xor(a, b) | Interval(a, b, _):
            return (a, b)
        case _:
            return ()


def walk(tree: Node) -> Iterator[tuple[Node, int]]:
    """Every node with its depth, parents first. It uses no recursion: a text may nest deeper than Python's stack."""
    stack = [(tree, 0)]
    while stack:
        node, depth = stack.pop()
        yield node, depth
        stack.extend((child, depth + 1) for child in reversed(children(node)))


def depth(tree: Node) -> int:
    """The depth of a tree: how many nodes are nested in each other at most."""
    return max(depth for _, depth in walk(tree))


def replaced(tree: Node, names: Mapping[str, Node], labels: Mapping[str, str]) -> Node:
    """A tree with names replaced by trees, and labels by other labels."""

    def of(part: object) -> object:
        if isinstance(part, tuple):
            return tuple(map(of, part))
        return replaced(part, names, labels) if isinstance(part, Node) else part

    if isinstance(tree, Name):
        return names.get(tree.name, tree)
    changed: dict[str, Any] = {f.name: of(getattr(tree, f.name)) for f in fields(tree) if f.name != "span"}
    if isinstance(tree, Index):
        changed["label"] = labels.get(tree.label, tree.label)
    return replace(tree, **changed)


def size(tree: Node) -> int:
    """How many nodes a tree holds when the body of each quantifier is written out for each label."""
    total, stack = 0, [(tree, 1)]
    while stack:
        node, copies = stack.pop()
        total += copies
        copies *= len(node.labels) if isinstance(node, ForEach) else 1
        stack.extend((child, copies) for child in children(node))
    return total


# Binding strength, loosest first; an operand that binds looser than its place needs parentheses.
_FOR_EACH, _IFF, _IMPLIES, _XOR, _OR, _AND, _UNTIL, _UNARY, _COMPARE, _SUM, _PRODUCT, _SIGN, _POWER, _ATOM = range(14)


def number_text(value: float) -> str:
    """The shortest text that reads back to the same float."""
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def value_text(value: float | tuple[float, ...]) -> str:
    """A constant's value as a spec writes it."""
    if isinstance(value, tuple):
        return "(" + ", ".join(map(number_text, value)) + ")"
    return number_text(value)


def text(node: Node) -> str:
    """The text of a tree, which parses back to an equal tree.

    It has only the parentheses that are needed, or that show a reader how different ones of U, R, W and T are joined.
    """
    return _write(node)[0]


def _at(node: Node, strength: int) -> str:
    written, own = _write(node)
    return written if own >= strength else f"({written})"


def _right_of(node: Node, right: Node) -> str:
    """The right operand of U, R, W or T; these four stand on one level."""
    mixed = isinstance(right, Until | Release | WeakUntil | Then) and type(right) is not type(node)
    return _at(right, _UNARY if mixed else _UNTIL)


def _write(node: Node) -> tuple[str, int]:
    """The text of a node and how strongly it binds."""
    match node:
        case Number(value):
            return number_text(value), _ATOM
        case Name(name):
            return name, _ATOM
        case Vector(items):
            return "(" + ", ".join(map(text, items)) + ")", _ATOM
        case Index(base, label):
            return f"{_at(base, _ATOM)}[{label}]", _ATOM
        case Component(base, axis):
            return f"{_at(base, _ATOM)}.{axis}", _ATOM
        case Call(function, arguments):
            return f"{function}(" + ", ".join(map(text, arguments)) + ")", _ATOM
        case Negative(a):
            return f"-{_at(a, _SIGN)}", _SIGN
        case Arithmetic("**", a, b):
            return f"{_at(a, _ATOM)} ** {_at(b, _SIGN)}", _POWER
        case Arithmetic(operator, a, b):
            own = _SUM if operator in "+-" else _PRODUCT
            return f"{_at(a, own)} {operator} {_at(b, own + 1)}", own
        case Comparison(operands, operators):
            first, *rest = (_at(a, _SUM) for a in operands)
            return first + "".join(f" {o} {a}" for o, a in zip(operators, rest, strict=True)), _COMPARE
        case Not(a):
            return f"!{_at(a, _UNARY)}", _UNARY
        case Next(a, strong):
            return f"{'X[!]' if strong else 'X'} {_at(a, _UNARY)}", _UNARY
        case Always(a, interval):
            return f"G{interval or ''} {_at(a, _UNARY)}", _UNARY
        case Eventually(a, interval):
            return f"F{interval or ''} {_at(a, _UNARY)}", _UNARY
        case Infinity():
            return "inf", _ATOM
        case Previous(a):
            return f"previous[!] {_at(a, _UNARY)}", _UNARY
        case Once(a, interval):
            return f"once{interval or ''} {_at(a, _UNARY)}", _UNARY
        case Historically(a, interval):
            return f"historically{interval or ''} {_at(a, _UNARY)}", _UNARY
        case Boolean(value):
            return "true" if value else "false", _ATOM
        case Interval(a, b, mark):
            return f"[{a}, {b}{mark}]", _ATOM
        case Until(a, b, interval):
            return f"{_at(a, _UNARY)} U{interval or ''} {_right_of(node, b)}", _UNTIL
        case Release(a, b, interval):
            return f"{_at(a, _UNARY)} R{interval or ''} {_right_of(node, b)}", _UNTIL
        case WeakUntil(a, b, interval):
            return f"{_at(a, _UNARY)} W{interval or ''} {_right_of(node, b)}", _UNTIL
        case Then(a, b, interval):
            return f"{_at(a, _UNARY)} T{interval or ''} {_right_of(node, b)}", _UNTIL
        case Since(a, b, interval):
            return f"{_at(a, _UNARY)} since{interval or ''} {_right_of(node, b)}", _UNTIL
        case And(operands):
            return " & ".join(_at(a, _UNTIL) for a in operands), _AND
        case Or(operands):
            return " | ".join(_at(a, _AND) for a in operands), _OR
        case Implies(a, b):
            return f"{_at(a, _XOR)} => {_at(b, _IMPLIES)}", _IMPLIES
        case Xor(a, b):
            return f"{_at(a, _XOR)} xor {_at(b, _OR)}", _XOR
        case Iff(a, b):
            return f"{_at(a, _IMPLIES)} <=> {_at(b, _IFF)}", _IFF
        case ForEach(quantifier, variable, labels, body):
            return f"{quantifier} {variable} in {', '.join(labels)}: {text(body)}", _FOR_EACH
        case Duration(seconds):
            return f"{number_text(seconds)} s", _ATOM
        case Period(seconds):
            return f"period {number_text(seconds)} s", _ATOM
        case Signal(name, dimension, is_boolean, variable, labels):
            family = f"[{variable} in {', '.join(labels)}]" if variable else ""
            return f"signal {name}{family}" + (
                "" if dimension is None else f"[{dimension}]"
            ) + ": bool" * is_boolean, _ATOM
        case Constant(name, label, value, is_duration):
            written = str(value) if isinstance(value, Node) else value_text(value) + " s" * is_duration
            return f"const {name}" + (f"[{label}]" if label else "") + f" = {written}", _ATOM
        case Definition(keyword, name, variable, labels, body, parameters):
            family = f"[{variable} in {', '.join(labels)}]" if variable else ""
            family += f"({', '.join(parameters)})" if parameters else ""
            return f"{keyword} {name}{family}{' =' if keyword == 'let' else ':'} {body}", _ATOM
        case Document(declarations, formula, True):
            return "\n".join(map(text, (*declarations, formula))), _ATOM
        case Document(declarations, formula):
            return "\n".join(map(text, declarations)) + f"\nspec: {formula}\n", _ATOM
        case _:
            raise TypeError(f"no text for {type(node).__name__}")
