"""The error for mistakes that the user has to mend, and how messages show names. Commands print it and exit with 2."""

from __future__ import annotations

from collections.abc import Iterable

MOST_NAMES = 30  # listed in one message


class UserError(ValueError):
    """A wrong config, spec, trace or folder: the message says where, what, and what to do."""


def printable(name: object, width: int = 80) -> str:
    """A name from a file, made safe for a message: one line, no control characters, at most `width` characters."""
    text = "".join(c if c.isprintable() else "?" for c in str(name)[: width + 1])
    return text if len(text) <= width else f"{text[:width]}..."


def shown(text: str) -> str:
    """Text made safe for a terminal, line by line: control characters in it become question marks."""
    return "\n".join("".join(c if c.isprintable() or c == "\t" else "?" for c in line) for line in text.split("\n"))


def nearest(name: object, valid: Iterable[object]) -> str:
    """'; did you mean ...?' with the closest valid name; '; there are: ...' if none is close; '' if none is valid."""
    from difflib import get_close_matches  # only a mistake needs it

    names = sorted(map(printable, valid))
    if not names:
        return ""
    if close := get_close_matches(str(name), names, n=1, cutoff=0.6):
        return f"; did you mean {close[0]}?"
    return f"; there are: {', '.join(names[:MOST_NAMES])}{', ...' if len(names) > MOST_NAMES else ''}"


def module_of(error: Exception) -> str:
    """The name of the module that raised an error."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return "" if trace is None else str(trace.tb_frame.f_globals["__name__"])
