"""Confidence intervals of a mean over seeds, and of a share of trials."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit  # scipy.stats has them, too, and takes a second to import

Array = NDArray[np.float64]

LEVEL = 0.95
FEWEST = 6  # values: with four the interval is 1.6 standard deviations to either side; the values themselves say more


def mean_interval(values: Array) -> tuple[Array, Array]:
    """The ends of Student's t interval of the mean over the last axis, in the shape without that axis.

    NaN where there are fewer than `FEWEST` values, or one is not finite. For normal values the interval holds the mean
    in a share `LEVEL` of all samples, however small they are. (A percentile bootstrap cannot reach beyond the values.
    It holds the mean in 0.50 of samples of two values, and in 0.79 of samples of four.)
    """
    count = values.shape[-1]
    if count < FEWEST:
        return np.full(values.shape[:-1], np.nan), np.full(values.shape[:-1], np.nan)
    known = np.where(np.isfinite(values), values, np.nan)
    mean, half = known.mean(axis=-1), stdtrit(count - 1, (1 + LEVEL) / 2) * known.std(axis=-1, ddof=1) / np.sqrt(count)
    return mean - half, mean + half


def share_interval(successes: int, trials: int) -> tuple[float, float]:
    """The ends of Wilson's interval of a share, at `LEVEL`, from 0 to 1.

    It holds the shares p whose score |k / n - p| / sqrt(p (1 - p) / n) is at most the normal quantile z (Wilson 1927).

    Args:
      successes: k of the trials.
      trials: n; at least 1.
    """
    k, n, z = successes, trials, ndtri((1 + LEVEL) / 2)
    centre, half = k + z**2 / 2, z * np.sqrt(k * (n - k) / n + z**2 / 4)
    return max(0.0, float((centre - half) / (n + z**2))), min(1.0, float((centre + half) / (n + z**2)))
