"""One row of clauses.csv: the values of the spec's parts on the sampled trajectories of one iteration."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic.parts import Parts
from tltlrl.store.clauses import CLAUSE, MEASURES, NAME, column

Array = NDArray[np.float64]


def standing(parts: Parts) -> dict[str, str]:
    """Column => value with five digits; empty where it is undefined, such as the mean of +inf and -inf.

    The value of a clause is its robustness. The value of a named sub-formula is its largest over the samples, `F name`.
    """
    row: dict[str, str] = {}
    for i, (text, values) in enumerate(parts.clauses.items()):
        row |= _columns(CLAUSE, text, (*_summary(values), np.mean(parts.clause == i)))
    for i, (name, values) in enumerate(parts.highest.items()):
        kept = np.mean(parts.lowest[name] > 0)
        row |= _columns(NAME, name, (*_summary(values), kept, np.mean(parts.name == i)))
    return row


def _summary(values: Array) -> tuple[np.floating, np.floating, np.floating]:
    """Mean, best, and the share above 0."""
    with np.errstate(invalid="ignore"):
        return values.mean(), values.max(), np.mean(values > 0)


def _columns(kind: str, part: str, values: tuple[np.floating, ...]) -> Mapping[str, str]:
    return {
        column(kind, measure, part): "" if math.isnan(value) else f"{value:.5g}"
        for measure, value in zip(MEASURES[kind], values, strict=True)
    }
