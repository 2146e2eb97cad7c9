"""The one error that a user, and not the code, has to mend; the commands print it and exit with 2."""

from __future__ import annotations

import traceback
from collections.abc import Iterable
from difflib import get_close_matches


class UserError(ValueError):
    """A wrong config, spec, trace or folder: the message says where, what, and what to do."""


def nearest(name: str, valid: Iterable[str]) -> str:
    """'; did you mean ...?' with the closest valid name, or the list of all if none is close, or nothing."""
    valid = sorted(valid)
    if not valid:
        return ""
    close = get_close_matches(name, valid, n=1, cutoff=0.5)
    return f"; did you mean {close[0]}?" if close else f"; there are: {', '.join(valid)}"


def module_of(error: Exception) -> str:
    """Where it was raised."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    return str(frame.f_globals["__name__"])
