"""Converts the bounds of a window to steps, from steps or seconds."""

import math

from tltlrl.logic.syntax import number_text

ROUNDING = 1e-9  # relative, of a computed bound: 0.7 / 0.1 is 6.999999999999999


def whole_number(value: float) -> int | None:
    """The whole number that was meant, if one was."""
    whole = round(value)
    return whole if math.isclose(value, whole, rel_tol=ROUNDING, abs_tol=ROUNDING) else None


def steps_of(value: float) -> int:
    """A bound given in steps, as a whole number.

    Raises:
      ValueError: if it is not a whole number from 0 on; it says what to write.
    """
    whole = whole_number(value)
    if whole is None or whole < 0:
        raise ValueError(
            f"the bound is {number_text(value)}; expected a whole number of steps from 0 on; "
            "plain numbers count samples, seconds are written with their unit, as in 0.5 s"
        )
    return whole


def samples_in(seconds: float, period: float | None) -> int:
    """A bound given in seconds, converted to steps of `period` (s).

    If no period is known, the number only serves to order bounds, and the spec cannot be evaluated.

    Raises:
      ValueError: if it is negative, or not a whole number of samples; it says what to write.
    """
    if seconds < 0:
        raise ValueError(f"the bound is {seconds:.12g} s; expected 0 s or more; time runs forwards")
    if period is None:
        return math.ceil(seconds * 1e6)
    steps = seconds / period
    whole = whole_number(steps)
    if whole is None:
        below, above = (f"{count * period:.12g} s" for count in (math.floor(steps), math.ceil(steps)))
        raise ValueError(
            f"the bound is {seconds:.12g} s, and samples are {period:.12g} s apart; expected a whole number of "
            f"samples; write {below} or {above}"
        )
    return whole
