"""Spec text to syntax tree."""

import re
from collections.abc import Iterator
from functools import cache
from itertools import pairwise

from lark import Lark, Token, Transformer, UnexpectedCharacters, UnexpectedInput, UnexpectedToken, v_args

from tltlrl.logic import advice, grammar, syntax
from tltlrl.logic.errors import Source, Span, SpecError
from tltlrl.logic.syntax import Node

# Every later pass recurses over one definition's tree at a time, so this bounds its use of Python's stack.
MAX_DEPTH = 100
MAX_LABELS = 1000  # of a range
# Operators and operands of one formula once its quantifiers are written out, label by label.
MAX_SIZE = 200_000


def span_of(token: Token) -> Span:
    """Where a token stands."""
    return Span(token.line or 1, token.column or 1, token.end_line or 1, token.end_column or 2)


Piece = Node | Token | None


class _Misread(Exception):
    """What the grammar allows and the language does not: where, and the problem."""

    def __init__(self, span: Span, problem: str) -> None:
        super().__init__(problem)
        self.span, self.problem = span, problem


# Words that no text can make a name of: those of the first edition, whose specs know no others.
RESERVED = {"signal", "const", "let", "def", "spec", "in", "all", "any", "and", "or", "not", "inf", *"GFXURWT"}


class _DeclaredWords:
    """A word that the text declares is a name in it, whatever it means elsewhere, and so is a label."""

    always_accept = ()

    def process(self, stream: Iterator[Token]) -> Iterator[Token]:
        """The tokens of one text, with those words as names."""
        tokens: list[Token] = []
        stop: UnexpectedCharacters | None = None
        try:
            tokens.extend(stream)
        except UnexpectedCharacters as mistake:
            stop = mistake  # reported after what stands before it
        declared = {str(b) for a, b in pairwise(tokens) if a.type in {"SIGNAL", "CONST", "LET", "DEF"}}
        before, is_label = "", False
        for token, after in zip(tokens, [*(token.type for token in tokens[1:]), ""], strict=False):
            is_label = (is_label or before == "IN") and token.type not in {"COLON", "RSQB"}
            in_brackets = before == "LSQB" and after in {"IN", "RSQB"}
            is_name = token in declared or is_label or in_brackets or before in {"DOT", "ALL", "ANY"}
            if is_name and token not in RESERVED and token.isidentifier():
                token = token.update(type="NAME")
            before = token.type
            yield token
        if stop is not None:
            raise stop


@v_args(inline=True)
class _TreeBuilder(Transformer[Token, object]):
    """Called by the parser at each reduction, bottom up: no recursion, however deep the text nests."""

    def document(self, *given: Node | Token | tuple[Node, ...]) -> syntax.Document:
        parts = [part for some in given for part in (some if isinstance(some, tuple) else (some,))]
        keyword = next(i for i, part in enumerate(parts) if isinstance(part, Token))
        formula = parts[keyword + 2]
        rest = (*parts[:keyword], *parts[keyword + 3 :])
        assert isinstance(formula, Node)
        declarations = tuple(d for d in rest if isinstance(d, syntax.Declaration))
        is_bare = all(isinstance(d, syntax.Period) for d in declarations)
        return syntax.Document(declarations, formula, is_bare, span=formula.span)

    def bare(self, *parts: Node | Token) -> syntax.Document:
        formula = parts[-1]
        assert isinstance(formula, Node)
        declarations = (self.period(*parts[:2]),) if len(parts) > 1 else ()  # type: ignore[arg-type]
        return syntax.Document(declarations, formula, True, span=formula.span)

    def period(self, keyword: Token, duration: Token) -> syntax.Period:
        return syntax.Period(_seconds(duration), span=span_of(keyword).to(span_of(duration)))

    def duration(self, token: Token) -> Node:
        return syntax.Duration(_seconds(token), span=span_of(token))

    def signal(self, _: Token, name: Token, *given: object) -> Node:
        variable, labels = given[0] if given and isinstance(given[0], tuple) else (None, ())
        rest = [token for token in given if isinstance(token, Token)]
        typed = (
            [token.type for token in rest].index("COLON") if "COLON" in {token.type for token in rest} else len(rest)
        )
        bracket = rest[:typed]
        span = span_of(name).to(span_of(rest[-1] if rest else name))
        dimension = None
        if rest[typed:] and (rest[-1] != "bool" or bracket):
            raise _Misread(
                span_of(rest[typed] if rest[-1] != "bool" else bracket[0]).to(span_of(rest[-1])),
                f"found '{rest[-1]}'; only a single signal that is true or false has a type, 'signal {name}: bool'; "
                "all others are numbers; delete what begins with the colon",
            )
        if bracket:
            # tltlrl.logic.declarations refuses 0, which stands for `signal x[2.5]`, and all numbers of five digits.
            dimension = int(bracket[1].lstrip("0")[:5] or 0) if bracket[1].isdecimal() else 0
        return syntax.Signal(str(name), dimension, bool(rest[typed:]), variable, labels, span=span)

    def constant(self, _: Token, name: Token, *rest: object) -> tuple[Node, ...]:
        labels = rest[1] if isinstance(rest[1], tuple) else (None,)
        value, span = rest[-1], span_of(name)
        assert isinstance(value, Node)
        values: tuple[Node, ...] = (value,)
        if len(labels) > 1:
            values = value.items if isinstance(value, syntax.Vector) else (value,)
            if len(values) != len(labels):
                raise _Misread(
                    value.span,
                    f"found {len(values)} value{'s' * (len(values) != 1)} for {len(labels)} labels; expected one for "
                    f"each; write a table, as const {name}[1, 2] = (0.5, 0.4)",
                )
        return tuple(_constant(str(name), label, own, span) for label, own in zip(labels, values, strict=True))

    def labels_between(self, first: Token, _: Token, last: Token) -> tuple[str, ...]:
        if not (first.isdecimal() and last.isdecimal() and int(first) <= int(last) < int(first) + MAX_LABELS):
            raise _Misread(
                span_of(first).to(span_of(last)),
                f"found the range {first}..{last}; expected whole numbers, the smaller first, {MAX_LABELS} at most; "
                "write for instance 1..3",
            )
        return tuple(map(str, range(int(first), int(last) + 1)))

    def labels(self, *parts: Token | tuple[str, ...]) -> tuple[str, ...]:
        members = (part for part in parts if isinstance(part, tuple) or part.type != "COMMA")
        return tuple(label for part in members for label in (part if isinstance(part, tuple) else (str(part),)))

    def parameters(self, *tokens: Token) -> list[str]:
        names = [str(token) for token in tokens if token.type == "NAME"]
        for token, name in zip((t for t in tokens if t.type == "NAME"), names, strict=True):
            if names.count(name) > 1:
                raise _Misread(span_of(token), f"the parameter '{name}' is listed twice; expected once; rename one")
        return names

    def family(self, _l: Token, variable: Token, _i: Token, labels: tuple[str, ...], _r: Token) -> object:
        return str(variable), labels

    def let(self, keyword: Token, name: Token, *rest: object) -> Node:
        variable, labels = rest[0] if isinstance(rest[0], tuple) else (None, ())
        parameters = tuple(rest[0]) if isinstance(rest[0], list) else ()
        body = rest[-1]
        assert isinstance(body, Node)
        return syntax.Definition(str(keyword), str(name), variable, labels, body, parameters, span=span_of(name))

    definition = let

    def for_each(
        self, quantifier: Token, variable: Token, _in: Token, labels: tuple[str, ...], _c: Token, body: Node
    ) -> Node:
        kind = "all" if quantifier.type == "ALL" else "any"
        return syntax.ForEach(kind, str(variable), labels, body, span=span_of(quantifier).to(body.span))

    def iff(self, left: Node, _: Token, right: Node) -> Node:
        return syntax.Iff(left, right, span=left.span.to(right.span))

    def implies(self, left: Node, _: Token, right: Node) -> Node:
        return syntax.Implies(left, right, span=left.span.to(right.span))

    def or_(self, *parts: Piece) -> Node:
        operands = _nodes(parts)
        return syntax.Or(operands, span=operands[0].span.to(operands[-1].span))

    def and_(self, *parts: Piece) -> Node:
        operands = _nodes(parts)
        return syntax.And(operands, span=operands[0].span.to(operands[-1].span))

    def until(self, left: Node, _: Token, *rest: Node) -> Node:
        return syntax.Until(left, rest[-1], _interval(rest), span=left.span.to(rest[-1].span))

    def release(self, left: Node, _: Token, *rest: Node) -> Node:
        return syntax.Release(left, rest[-1], _interval(rest), span=left.span.to(rest[-1].span))

    def weak_until(self, left: Node, _: Token, *rest: Node) -> Node:
        return syntax.WeakUntil(left, rest[-1], _interval(rest), span=left.span.to(rest[-1].span))

    def then(self, left: Node, _: Token, *rest: Node) -> Node:
        return syntax.Then(left, rest[-1], _interval(rest), span=left.span.to(rest[-1].span))

    def since(self, left: Node, _: Token, *rest: Node) -> Node:
        return syntax.Since(left, rest[-1], _interval(rest), span=left.span.to(rest[-1].span))

    def previous(self, operator: Token, operand: Node) -> Node:
        return syntax.Call("previous", (operand,), span=span_of(operator).to(operand.span))

    def strong_previous(self, operator: Token, operand: Node) -> Node:
        return syntax.Previous(operand, span=span_of(operator).to(operand.span))

    def once(self, operator: Token, *rest: Node) -> Node:
        return syntax.Once(rest[-1], _interval(rest), span=span_of(operator).to(rest[-1].span))

    def historically(self, operator: Token, *rest: Node) -> Node:
        return syntax.Historically(rest[-1], _interval(rest), span=span_of(operator).to(rest[-1].span))

    def xor(self, left: Node, _: Token, right: Node) -> Node:
        return syntax.Xor(left, right, span=left.span.to(right.span))

    def true(self, token: Token) -> Node:
        return syntax.Boolean(True, span=span_of(token))

    def false(self, token: Token) -> Node:
        return syntax.Boolean(False, span=span_of(token))

    def not_(self, operator: Token, operand: Node) -> Node:
        return syntax.Not(operand, span=span_of(operator).to(operand.span))

    def next(self, operator: Token, operand: Node) -> Node:
        return syntax.Next(operand, span=span_of(operator).to(operand.span))

    def strong_next(self, operator: Token, operand: Node) -> Node:
        return syntax.Next(operand, True, span=span_of(operator).to(operand.span))

    def always(self, operator: Token, *rest: Node) -> Node:
        return syntax.Always(rest[-1], _interval(rest), span=span_of(operator).to(rest[-1].span))

    def eventually(self, operator: Token, *rest: Node) -> Node:
        return syntax.Eventually(rest[-1], _interval(rest), span=span_of(operator).to(rest[-1].span))

    def interval(self, left: Token, lower: Node, _: Token, upper: Node, *rest: Token) -> Node:
        mark = "" if len(rest) == 1 else "?" if rest[0].type == "MAYBE" else "!"
        return syntax.Interval(lower, upper, mark, span=span_of(left).to(span_of(rest[-1])))

    def endless(self, left: Token, lower: Node, _: Token, end: Token, right: Token) -> Node:
        return syntax.Interval(lower, syntax.Infinity(span=span_of(end)), span=span_of(left).to(span_of(right)))

    def comparison(self, *parts: Piece) -> Node:
        operands = _nodes(parts)
        operators = tuple(str(p).replace("≤", "<=").replace("≥", ">=") for p in parts if isinstance(p, Token))
        return syntax.Comparison(operands, operators, span=operands[0].span.to(operands[-1].span))

    def arithmetic(self, left: Node, operator: Token, right: Node) -> Node:
        symbol = {"MINUS": "-", "STAR": "*"}.get(operator.type, str(operator))
        return syntax.Arithmetic(symbol, left, right, span=left.span.to(right.span))

    def negative(self, operator: Token, operand: Node) -> Node:
        return syntax.Negative(operand, span=span_of(operator).to(operand.span))

    def index(self, base: Node, _: Token, label: Token, bracket: Token) -> Node:
        return syntax.Index(base, str(label), span=base.span.to(span_of(bracket)))

    def component(self, base: Node, _: Token, axis: Token) -> Node:
        return syntax.Component(base, str(axis), span=base.span.to(span_of(axis)))

    def number(self, token: Token) -> Node:
        return syntax.Number(float(token), span=span_of(token))

    def name(self, token: Token) -> Node:
        return syntax.Name(str(token), span=span_of(token))

    def call(self, name: Token, *rest: Piece) -> Node:
        assert isinstance(rest[-1], Token)
        return syntax.Call(
            "previous" if name == "prev" else str(name), _nodes(rest), span=span_of(name).to(span_of(rest[-1]))
        )

    def parentheses(self, _l: Token, inner: Node, _r: Token) -> Node:
        return inner

    def vector(self, *parts: Piece) -> Node:
        first, last = parts[0], parts[-1]
        assert isinstance(first, Token)
        assert isinstance(last, Token)
        return syntax.Vector(_nodes(parts), span=span_of(first).to(span_of(last)))


def _constant(name: str, label: str | None, value: Node, span: Span) -> syntax.Constant:
    """A constant whose value is written down, or, if it is not, a tree that is yet to be computed."""
    if isinstance(value, syntax.Duration):
        return syntax.Constant(name, label, value.seconds, True, span=span)
    number = _literal(value)
    if number is not None:
        return syntax.Constant(name, label, number, span=span)
    items = tuple(map(_literal, value.items)) if isinstance(value, syntax.Vector) else (None,)
    numbers = tuple(item for item in items if item is not None)
    return syntax.Constant(name, label, numbers if len(numbers) == len(items) else value, span=span)


def _literal(node: Node) -> float | None:
    match node:
        case syntax.Number(value):
            return value
        case syntax.Negative(syntax.Number(value)):
            return -value
    return None


def _seconds(token: Token) -> float:
    """`1.5 s`, `20 ms`, `2 min` in seconds."""
    number, unit = re.fullmatch(r"(.*?)\s*(s|ms|min)", str(token)).groups()  # type: ignore[union-attr]
    return {"s": float(number), "ms": float(number) / 1000, "min": float(number) * 60}[unit]


def _nodes(parts: tuple[Piece, ...]) -> tuple[Node, ...]:
    return tuple(part for part in parts if isinstance(part, Node))


def _interval(rest: tuple[Node, ...]) -> syntax.Interval | None:
    return rest[0] if isinstance(rest[0], syntax.Interval) else None


@cache
def _parser() -> Lark:
    return grammar.parser(_TreeBuilder(), _DeclaredWords())


def parse(source: Source) -> syntax.Document:
    """The syntax tree of a spec's text.

    Raises:
      SpecError: at the first thing that is no TLTL.
    """
    code = _without_comments(source.text).rstrip()
    if not code:
        found = "the text is empty" if not source.text.strip() else "the text holds comments only"
        raise SpecError(source, Span(), f"{found}; a spec needs a formula; write one, such as G (x < 1)")
    if code.endswith(".tltl"):
        raise SpecError(source, Span(), "this is a path; expected the text of a spec; load_spec reads one from a file")
    document = None
    try:
        document = _parser().parse(source.text)
    except UnexpectedInput as mistake:
        error = _explain(source, mistake)
    except _Misread as mistake:
        error = SpecError(source, mistake.span, mistake.problem)
    if document is None:
        raise error  # out here it has no context: lark's own error holds a parser, which cannot go to another process
    assert isinstance(document, syntax.Document)
    definitions = [d for d in document.declarations if isinstance(d, syntax.Definition)]
    values = (d.value for d in document.declarations if isinstance(d, syntax.Constant))
    for tree in (*(d.body for d in definitions), *(v for v in values if isinstance(v, Node)), document.formula):
        for node, depth in syntax.walk(tree):
            if depth > MAX_DEPTH:
                raise SpecError(
                    source,
                    node.span,
                    f"this is nested more than {MAX_DEPTH} operators deep; expected less; "
                    "name parts of it with 'def' or 'let'",
                )
    for tree, copies in (*((d.body, len(d.labels) or 1) for d in definitions), (document.formula, 1)):
        if (size := syntax.size(tree) * copies) > MAX_SIZE:
            raise SpecError(
                source,
                tree.span,
                f"with its quantifiers written out this holds {size} operators and operands; expected at most "
                f"{MAX_SIZE}; name what an inner quantifier says with 'def', which is read once",
            )
    return document


def _explain(source: Source, mistake: UnexpectedInput) -> SpecError:
    """Turn the parser's complaint into one that says what to do."""
    if isinstance(mistake, UnexpectedCharacters):
        span = Span(mistake.line, mistake.column, mistake.line, mistake.column + 1)
        return SpecError(source, span, advice.unknown_character(mistake.char))
    assert isinstance(mistake, UnexpectedToken)
    token, accepts = mistake.token, set(mistake.accepts or mistake.expected)
    code = _without_comments(source.text)
    if token.type == "$END":
        lines = code.rstrip().split("\n")
        end = len(lines[-1]) + 1
        return SpecError(
            source,
            Span(len(lines), end, len(lines), end + 1),
            f"the text ends here; {advice.expected(token, accepts, code, '')}",
        )
    before, after = code[: token.start_pos], code[token.end_pos :]
    return SpecError(source, span_of(token), f"found '{token}'; {advice.expected(token, accepts, before, after)}")


def _without_comments(text: str) -> str:
    """The text with blanks in the place of comments."""
    return re.sub(r"#[^\n]*", lambda comment: " " * len(comment[0]), text)
