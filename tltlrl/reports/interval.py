"""How far a mean over seeds, or a share of trials, can be trusted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri, stdtrit  # scipy.stats has them, too, and takes a second to import

Array = NDArray[np.float64]

LEVEL = 0.95
FEWEST = 6  # values: of four the interval is 1.6 standard deviations to either side, and each value says more


def mean_interval(values: Array) -> tuple[Array, Array]:
    """Student's t interval of the mean over the last axis: its ends, of the shape without that axis.

    It holds the mean of normal values in `LEVEL` of all samples, of however few values they are. (A percentile
    bootstrap, which cannot reach beyond the values there are, does so in 0.50 of samples of two and in 0.79 of samples
    of four.) NaN where there are fewer than `FEWEST` values, or one is not finite.
    """
    count = values.shape[-1]
    if count < FEWEST:
        return np.full(values.shape[:-1], np.nan), np.full(values.shape[:-1], np.nan)
    known = np.where(np.isfinite(values), values, np.nan)
    mean, half = known.mean(axis=-1), stdtrit(count - 1, (1 + LEVEL) / 2) * known.std(axis=-1, ddof=1) / np.sqrt(count)
    return mean - half, mean + half


def share_interval(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's interval of a share, at `LEVEL`: its ends, from 0 to 1.

    Those shares p whose score |k / n - p| / sqrt(p (1 - p) / n) is at most the normal quantile z (Wilson 1927).

    Args:
      successes: k of the trials.
      trials: n; at least 1.
    """
    k, n, z = successes, trials, ndtri((1 + LEVEL) / 2)
    centre, half = k + z**2 / 2, z * np.sqrt(k * (n - k) / n + z**2 / 4)
    return max(0.0, float((centre - half) / (n + z**2))), min(1.0, float((centre + half) / (n + z**2)))
