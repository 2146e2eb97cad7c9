"""The one error that a user, and not the code, has to mend; the commands print it and exit with 2."""

from __future__ import annotations

import traceback
from collections.abc import Iterable
from difflib import get_close_matches

MOST_NAMES = 30  # that a message lists


class UserError(ValueError):
    """A wrong config, spec, trace or folder: the message says where, what, and what to do."""


def printable(name: object, width: int = 80) -> str:
    """A name from a file as a message may show it: on one line, without control characters, and not endless."""
    text = "".join(c if c.isprintable() else "?" for c in str(name)[: width + 1])
    return text if len(text) <= width else f"{text[:width]}..."


def shown(text: str) -> str:
    """Lines as a terminal may show them, whatever names from files and folders they hold: no control characters."""
    return "\n".join("".join(c if c.isprintable() or c == "\t" else "?" for c in line) for line in text.split("\n"))


def nearest(name: object, valid: Iterable[object]) -> str:
    """'; did you mean ...?' with the closest valid name, or '; there are: ...' if none is close, or nothing at all."""
    names = sorted(map(printable, valid))
    if not names:
        return ""
    if close := get_close_matches(str(name), names, n=1, cutoff=0.6):
        return f"; did you mean {close[0]}?"
    return f"; there are: {', '.join(names[:MOST_NAMES])}{', ...' if len(names) > MOST_NAMES else ''}"


def module_of(error: Exception) -> str:
    """Where it was raised."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    return str(frame.f_globals["__name__"])
