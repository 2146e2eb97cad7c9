"""A 95 % interval holds the mean in 95 % of samples, also of few values."""

import numpy as np
import pytest

from tltlrl.reports.interval import FEWEST, LEVEL, mean_interval, share_interval


@pytest.mark.parametrize("count", [FEWEST, 10, 20])
def test_the_interval_keeps_its_word(count):
    """40 000 experiments of so many seeds: the coverage is known to 0.1 %."""
    values = np.random.default_rng(count).normal(0.3, 2.0, size=(40_000, count))
    low, high = mean_interval(values)
    assert np.mean((low < 0.3) & (high > 0.3)) == pytest.approx(LEVEL, abs=0.005)


def test_of_too_few_values_or_one_that_is_not_finite_there_is_none():
    assert np.isnan(mean_interval(np.ones((5, FEWEST - 1)))).all()
    values = np.ones((2, FEWEST))
    values[1, 2] = -np.inf
    np.testing.assert_array_equal(mean_interval(values), [[1.0, np.nan]] * 2)


def test_by_hand():
    """Mean 3.5, standard error 0.7638, t quantile 2.5706 of five degrees of freedom."""
    np.testing.assert_allclose(mean_interval(np.arange(1.0, 7.0)), [1.5367, 5.4633], atol=1e-4)


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (7, 10), (10, 10), (1912, 2000)])
def test_the_interval_of_a_share_is_wilsons(successes, trials):
    """The roots p of (share - p)^2 = z^2 p (1 - p) / n, with z = 1.959964."""
    z, share = 1.959964, successes / trials
    roots = np.roots([1 + z**2 / trials, -2 * share - z**2 / trials, share**2])
    np.testing.assert_allclose(share_interval(successes, trials), np.clip(sorted(roots), 0, 1), atol=1e-6)
