"""Tests whether one case is better than another: paired over common seeds, corrected for several tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]

EXACT_PAIRS = 20
RANDOM_EXCHANGES = 2**16 - 1


@dataclass(frozen=True)
class Comparison:
    """The comparison of case `better` with case `other` by one measure, on n common seeds.

    Attributes:
      better, other: names of the cases.
      measure: column of summary.csv.
      seeds: n.
      difference: mean over the seeds of better - other, in the measure's unit.
      wins: P(better > other), the share of seed pairs (any seed against any) in which it is, ties counting half.
      p: paired permutation test of the mean difference, two-sided, Holm-corrected over the family; see `paired_p`.
    """

    better: str
    other: str
    measure: str
    seeds: int
    difference: float
    wins: float
    p: float


def compare(summary: pd.DataFrame, pairs: list[tuple[str, str]], measure: str) -> list[Comparison]:
    """Compares each pair of cases; all pairs are one family for Holm's correction.

    Args:
      summary: summary.csv; one row per case and seed.
      pairs: names of two cases; the question is whether the first is better than the second.
      measure: column of `summary`.
    """
    table = summary.pivot(index="seed", columns="case", values=measure)
    scores = [table[[better, other]].dropna().to_numpy().T for better, other in pairs]
    corrected = holm([paired_p(a, b) for a, b in scores])
    return [
        Comparison(better, other, measure, len(a), float(np.mean(a - b)), probability_of_superiority(a, b), p)
        for (better, other), (a, b), p in zip(pairs, scores, corrected, strict=True)
    ]


def paired_p(a: Array, b: Array) -> float:
    """The two-sided p of the mean of a - b under all 2^n exchanges within the n pairs; at least 2^(1 - n).

    With more than `EXACT_PAIRS` pairs, it uses `RANDOM_EXCHANGES` random exchanges.
    """
    if len(a) < 2 or np.array_equal(a, b):
        return 1.0
    difference = a - b
    if len(difference) > EXACT_PAIRS:
        from scipy.stats import permutation_test  # slow to import, and rarely needed: few have so many pairs

        result = permutation_test(
            (a, b),
            lambda x, y, axis: np.mean(x - y, axis=axis),
            permutation_type="samples",
            n_resamples=RANDOM_EXCHANGES,
            vectorized=True,
            rng=np.random.default_rng(0),
        )
        return float(result.pvalue)
    sums = np.zeros(1)  # an exchange turns the sign of a difference; SciPy takes ten seconds for the sums of 20 pairs
    for value in difference:
        sums = np.concatenate([sums + value, sums - value])
    return float(np.mean(np.abs(sums) >= abs(difference.sum()) - 1e-12 * np.abs(difference).sum()))


def probability_of_superiority(a: Array, b: Array) -> float:
    """P(A > B) over all pairs of seeds, ties counting half."""
    return float(np.mean((a[:, None] > b) + 0.5 * (a[:, None] == b)))


def holm(p: list[float]) -> list[float]:
    """Holm's step-down correction: sorted p times the number of hypotheses left, never falling, at most 1."""
    order = np.argsort(p)
    scaled = np.array(p)[order] * np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(np.maximum.accumulate(scaled), 1.0)
    return [float(value) for value in adjusted]
