"""What the writer of a spec probably meant, where the parser stops: an ordered table of condition and advice."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass

from lark import Token

from tltlrl.logic.errors import elsewhere

OPERATORS = {
    "SIGNAL": "declares a signal",
    "CONST": "declares a constant",
    "LET": "names a derived signal",
    "DEF": "names a sub-formula",
    "SPEC": "begins the formula that is the spec",
    "IN": "is part of 'all i in ...'",
    "ALL": "is 'for all of'",
    "ANY": "is 'for any of'",
    "OR": "is 'or'",
    "AND": "is 'and'",
    "NOT": "is 'not'",
    "UNTIL": "is the operator 'until'",
    "RELEASE": "is the operator 'release'",
    "WEAK": "is the operator 'weak until'",
    "THEN": "is the operator 'then'",
    "INFINITY": "is infinity, the end of an interval",
    "NEXT": "is the operator 'next'",
    "ALWAYS": "is the operator 'always'",
    "EVENTUALLY": "is the operator 'eventually'",
    "XOR": "is the operator 'xor'",
    "SINCE": "is the operator 'since'",
    "PREVIOUS": "is the operator 'previous'",
    "STRONG_PREVIOUS": "is the operator 'previous'",
    "ONCE": "is the operator 'once'",
    "HISTORICALLY": "is the operator 'historically'",
    "TRUE": "is 'true'",
    "FALSE": "is 'false'",
}
DECLARATIONS = {name.upper(): name for name in ("signal", "const", "let", "def", "spec")}
NO_EQUALITY = "a formula has no equality, its robustness would never be positive; write abs(a - b) < tolerance"
LITERAL = "a vector stands in parentheses, as in const goal = (1.5, -2)"
MARKS = {"RPAR": ")", "RSQB": "]", "COMMA": ",", "COLON": ":", "ASSIGN": "=", "IN": "in"}


@dataclass(frozen=True)
class Stop:
    """Where the parser stops.

    Attributes:
      token: the token that cannot stand there; its type is $END at the end of the text.
      accepts: types of the tokens that can stand there.
      text: the text before it, or its end if it is long.
      before: the word or sign before it, "" at the start.
      after: the text after it.
      within: the keyword of the declaration that it stands in, "" if there is none.
    """

    token: Token
    accepts: frozenset[str]
    text: str
    before: str
    after: str
    within: str

    @property
    def kind(self) -> str:
        """The token's type."""
        return self.token.type

    @property
    def missing(self) -> list[str]:
        """The punctuation marks that can stand here, the most likely first."""
        accepts = self.accepts - ({"COLON"} if "DOTS" in self.accepts else set())
        return [] if self.declaration_wanted else [mark for name, mark in MARKS.items() if name in accepts]

    @property
    def marks(self) -> str:
        """The marks that could close an open bracket or list, as alternatives to an operator."""
        return "".join(f" or '{mark}'" for mark in (")", ",") if mark in self.missing)

    @property
    def meant(self) -> str | None:
        """The keyword of a declaration, if one of the words here is that keyword in capitals; otherwise None."""
        keywords = DECLARATIONS.values()
        words = (str(self.token), self.before) if self.kind in {"NAME", "COLON"} else ()
        return next((w.lower() for w in words if w not in keywords and w.lower() in keywords), None)

    @property
    def foreign(self) -> str | None:
        """Advice for a word of another language, here or before."""
        return (self.kind == "NAME" and elsewhere(str(self.token))) or elsewhere(self.before)

    @property
    def windowed(self) -> str | None:
        """Advice for a word of another language before the bracket that is open here."""
        word = re.search(r"(\w+)\s*\[[^\[\]]*$", self.text)
        return elsewhere(word[1]) if word else None

    @property
    def named(self) -> str | None:
        """The name that the text defines here without a keyword: `p := ...`, or `p = ...` with a formula."""
        if self.kind == "NAME" and self.declaration_wanted and re.match(r"\s*:?=(?!=)", self.after):
            return str(self.token)
        given = self.after.startswith("=") if self.kind == "COLON" else re.match(r"(?!=).*[<>]", self.after)
        return self.before if self.text.strip() == self.before != "" and self.is_naming and given else None

    @property
    def is_naming(self) -> bool:
        """Whether a sign stands here that defines names in other languages."""
        return self.kind in {"ASSIGN", "COLON"} and self.before.isidentifier()

    @property
    def name_wanted(self) -> bool:
        """Whether nothing but a name can stand here."""
        return self.accepts == {"NAME"}

    @property
    def operand_wanted(self) -> bool:
        """Whether a formula or an expression begins here."""
        return {"NAME", "LPAR"} <= self.accepts

    @property
    def operator_wanted(self) -> bool:
        """Whether a formula has just ended."""
        return "AND" in self.accepts

    @property
    def operand_found(self) -> bool:
        """Whether an operand, or the start of one, stands where an operator is wanted."""
        return self.operator_wanted and (self.kind in {"NAME", "NUMBER", "LPAR", "NOT"} or self.kind in OPERATORS)

    @property
    def declaration_wanted(self) -> bool:
        """Whether a declaration has just ended."""
        return "SPEC" in self.accepts


Condition = Callable[[Stop], bool]
Advice = Callable[[Stop], str]

# The first row whose condition holds gives the advice; a test reaches every row.
TABLE: tuple[tuple[Condition, Advice], ...] = (
    (lambda s: s.meant is not None, lambda s: f"expected a declaration or a formula; did you mean {s.meant}?"),
    (
        lambda s: s.named is not None,
        lambda s: (
            f"expected a declaration or a formula; name a formula by 'def {s.named}: ...', a number by "
            f"'let {s.named} = ...', and begin the formula that is the spec with 'spec:'"
        ),
    ),
    (
        lambda s: s.name_wanted and s.before == ".",
        lambda _: "expected a component after the dot; write .x, .y or .z, or an index in brackets, as in ee[0]",
    ),
    (
        lambda s: s.name_wanted and s.kind in OPERATORS,
        lambda s: (
            f"expected a name, and '{s.token}' {OPERATORS[s.kind]}; use another name, such as '{_renamed(s.token)}'"
        ),
    ),
    (lambda s: s.name_wanted, lambda _: "expected a name; names begin with a letter"),
    (
        lambda s: s.accepts == {"NUMBER"} and s.text.rstrip().endswith(".."),
        lambda _: "expected a whole number; a range ends with one, as in 1..3",
    ),
    (
        lambda s: s.accepts in ({"NUMBER"}, {"IN"}) and s.within == "signal",
        lambda _: "expected a dimension, a whole number; write for instance ee[2], and for a family ped[i in 1..3][2]",
    ),
    (
        lambda s: s.accepts == {"DURATION"},
        lambda _: "expected a duration; write it with its unit (s, ms or min), as in 0.05 s",
    ),
    (
        lambda s: s.kind == "INFINITY",
        lambda _: "expected a finite number; infinity can only end an interval, as in F[2, inf]",
    ),
    (
        lambda s: s.operand_wanted and s.kind in DECLARATIONS,
        lambda s: f"expected a formula or a number; complete what stands before '{s.token}'",
    ),
    (
        lambda s: s.operand_wanted and s.kind in {"COMMA", "RPAR"},
        lambda _: "expected a formula or a number before it; write one or delete what is too much",
    ),
    (
        lambda s: s.operand_wanted and s.kind in {"ALL", "ANY"},
        lambda s: f"expected an operand; put parentheses around it: ({s.token} i in ...: ...)",
    ),
    (
        lambda s: s.operand_wanted and s.kind == "LSQB" and s.before in {"X", "next", "previous", "○", "◯"},
        lambda _: (
            "this operator takes no interval; delete it (X[!] is the strong next, previous[!] the strong previous)"
        ),
    ),
    (
        lambda s: s.operand_wanted and s.kind in {"LESS", "GREATER"} and s.before in {"<", ">"},
        lambda _: "expected a number or a name; a comparison is <, <=, > or >=",
    ),
    (lambda s: s.operand_wanted, lambda _: "expected a formula or a number; write an operand here"),
    (
        lambda s: s.kind == "ASSIGN" and "COLON" in s.accepts,
        lambda _: "expected ':'; a sub-formula is named by 'def name: formula', a number by 'let name = expression'",
    ),
    (
        lambda s: s.kind == "ASSIGN" and s.after.startswith("=>"),
        lambda _: "expected an operator; 'implies' is written =>",
    ),
    (lambda s: s.kind == "ASSIGN" or (s.kind == "NOT" and s.after.startswith("=")), lambda _: NO_EQUALITY),
    (
        lambda s: s.kind == "COLON" and "ASSIGN" in s.accepts,
        lambda _: "expected '='; a number is named by 'let name = expression', a formula by 'def name: formula'",
    ),
    (
        lambda s: bool(s.accepts & {"NUMBER", "NAME"}) and "LPAR" not in s.accepts,
        lambda _: "expected a label or a number; write for instance [r] or [2]",
    ),
    (lambda s: s.kind == "$END" and bool(s.missing), lambda s: f"expected '{s.missing[0]}'; close what is open"),
    (
        lambda s: s.declaration_wanted and s.within == "const" and s.kind == "COMMA",
        lambda _: f"expected the next declaration; {LITERAL}",
    ),
    (
        lambda s: s.declaration_wanted and s.kind == "COMMA",
        lambda s: (
            f"expected the next declaration; each name has one of its own: write '{s.within}' in place of the comma"
        ),
    ),
    (
        lambda s: (
            s.declaration_wanted
            and s.within == "const"
            and s.kind == "NAME"
            and re.search(r"\d[ \t]*\Z", s.text) is not None
        ),
        lambda s: (
            f"expected the next declaration; times alone have a unit (s, ms, min): write '# {s.token}', a comment"
        ),
    ),
    (
        lambda s: s.operand_found and s.declaration_wanted and re.search(r"\n\s*\Z", s.text) is not None,
        lambda _: (
            "expected an operator, the next declaration (signal, const, let, def) or the formula, 'spec: ...'; "
            "begin it with one of these words, the formula with 'spec:'"
        ),
    ),
    (
        lambda s: s.operand_found and s.foreign is not None,
        lambda s: f"expected an operator{s.marks}; {s.foreign}",
    ),
    (
        lambda s: s.operand_found,
        lambda s: f"expected an operator{s.marks}; join the two parts, for instance with & or |",
    ),
    (
        lambda s: s.operator_wanted,
        lambda s: f"expected an operator{s.marks} or the end; delete it or close what was opened",
    ),
    (
        lambda s: s.windowed is not None and s.kind in {"COMMA", "COLON"},
        lambda s: f"expected an operator before the interval; {s.windowed}",
    ),
    (
        lambda s: s.kind == "RPAR" and s.missing == ["]"],
        lambda _: "expected ']'; an interval holds both of its bounds, so that [0, 5) is [0, 4]",
    ),
    (lambda s: bool(s.missing), lambda s: f"expected {' or '.join(map(repr, s.missing))}; write it here"),
    (
        lambda s: s.declaration_wanted and s.within == "signal" and s.kind == "LSQB",
        lambda _: (
            "expected the next declaration; a signal is one number or one vector: declare several, "
            "as 'signal a[2] signal b[2]', or a family, as 'signal a[i in 1..3][2]'"
        ),
    ),
    (
        lambda s: s.declaration_wanted and re.search(r"(?<!\w)spec\s*:", s.after) is not None,
        lambda _: (
            "expected a declaration (signal, const, let, def) or the formula, 'spec: ...'; "
            "delete it or begin it with one of these words"
        ),
    ),
    (
        lambda s: s.declaration_wanted,
        lambda _: (
            "expected a declaration (signal, const, let, def) or the formula, 'spec: ...'; "
            "add the line that begins with 'spec:'"
        ),
    ),
    (
        lambda s: s.kind == "SPEC",
        lambda _: "expected the end of the text; a spec has one formula: join the two with &",
    ),
    (
        lambda s: s.kind in {"RPAR", "RSQB"},
        lambda _: "expected an operator or the end; nothing is open here: delete it",
    ),
    (
        lambda _: True,
        lambda _: "expected an operator or the end; delete it or join the two parts with an operator",
    ),
)


def expected(token: Token, accepts: set[str], text: str, after: str) -> str:
    """Advice: what could stand in place of `token`, and what to do.

    Args:
      token: where the parser stops.
      accepts: types of the tokens that can stand there.
      text, after: the spec before and after the token, without comments.
    """
    before = re.findall(r"\w+$|\S$|$", text.rstrip()[-100:])[0]
    within = ["", *re.findall(rf"\b(?:{'|'.join(DECLARATIONS.values())})\b", text)][-1]
    stop = Stop(token, frozenset(accepts), text[-200:], before, after, within)
    return next(advice(stop) for condition, advice in TABLE if condition(stop))


def unknown_character(char: str) -> str:
    """What to do about a character that has no meaning in a spec."""
    advice = {
        "^": "for a power write **, for 'and' write &",
        ";": "a declaration ends where the next one begins: delete it",
        '"': "names are written without quotes",
        "'": "names are written without quotes",
        "%": "comments begin with #",
        "≠": NO_EQUALITY,
        "@": "names hold letters, digits and _",
        "$": "names hold letters, digits and _",
    }.get(char, "see the operator table in docs/spec-language.md")
    if unicodedata.category(char) in {"Zs", "Cf"}:
        advice = "this is a space of another kind, or none: write a plain one or delete it"
    return f"found the character {char!r}; it has no meaning in a spec; {advice}"


def _renamed(token: Token) -> str:
    word = str(token).strip()
    return f"{word.lower()}_" if word.isidentifier() else "p"
