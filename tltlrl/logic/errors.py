"""Errors that point: where in which file, what was found, what was expected, what to do."""

from dataclasses import dataclass

from tltlrl.errors import UserError

# A source line longer than this is shown as a window around the caret.
SHOWN_WIDTH = 120


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of source text. Lines and columns count from 1; `end_column` is one past the last character."""

    line: int = 1
    column: int = 1
    end_line: int = 1
    end_column: int = 2

    def to(self, other: "Span") -> "Span":
        """The span from the start of this one to the end of another."""
        return Span(self.line, self.column, other.end_line, other.end_column)


NOWHERE = Span()


@dataclass(frozen=True, slots=True)
class Source:
    """A spec's text, and the name that messages use for it (its path, or `<spec>`)."""

    name: str
    text: str

    def message(self, span: Span, problem: str) -> str:
        """The text of an error: `name:line:column: problem`, then the source line, then a caret under the span."""
        lines = self.text.split("\n")
        line = "".join(c if c.isprintable() else " " for c in lines[span.line - 1])
        start = span.column - 1
        stop = span.end_column - 1 if span.end_line == span.line else len(line)
        first = max(0, start - SHOWN_WIDTH // 2) if len(line) > SHOWN_WIDTH else 0
        shown = line[first : first + SHOWN_WIDTH]
        before, after = "..." * (first > 0), "..." * (first + SHOWN_WIDTH < len(line))
        caret = " " * (len(before) + start - first) + "^" + "~" * (min(stop, first + len(shown)) - start - 1)
        margin = f"{span.line:>5} | "
        return (
            f"{self.name}:{span.line}:{span.column}: {problem}\n"
            f"{margin}{before}{shown}{after}\n{' ' * (len(margin) - 2)}| {caret}"
        )


class _PointingError(UserError):
    """A UserError whose text is `Source.message`."""

    def __init__(self, source: Source, span: Span, problem: str) -> None:
        super().__init__(source, span, problem)
        self.source, self.span, self.problem = source, span, problem

    def __str__(self) -> str:
        return self.source.message(self.span, self.problem)


class SpecError(_PointingError):
    """A mistake in a spec or in the constants that override its own. It is raised before anything runs."""


class TraceError(_PointingError):
    """A spec cannot be evaluated on the given signals. The message shows the place in the spec that needs them."""


# What other languages and logics call it -> what is written here.
_WRITTEN = {
    **dict.fromkeys(("always", "globally", "alw", "alw_"), "G"),
    **dict.fromkeys(("eventually", "finally", "ev", "ev_"), "F"),
    **{word: word for word in ("once", "historically", "since", "previous", "xor", "true", "false")},
    "next": "X",
    "until": "U",
    "release": "R",
    "unless": "W",
    "then": "T",
    "implies": "=>",
    "iff": "<=>",
    "and": "&",
    "or": "|",
    "not": "!",
}
_OF_BREACH = {"alw", "alw_", "ev", "ev_"}  # all others are words here, too, in small letters


def elsewhere(word: str) -> str | None:
    """Advice for a word that means something in other languages, but nothing here; None for any other word."""
    if len(word) > 1 and set(word) <= set("GFXURWT"):
        return f"'{word}' is one name: write the operators apart, as {' '.join(word)}"
    if word.lower() in _WRITTEN and (word != word.lower() or word in _OF_BREACH):
        return f"'{word}' is written {_WRITTEN[word.lower()]}"
    return None
