import itertools

import numpy as np
import pandas as pd
import pytest

from tltlrl.reports.comparison import compare, holm, paired_p, probability_of_superiority


@pytest.mark.parametrize("n", [2, 4, 7, 12])
def test_the_paired_p_is_the_share_of_exchanges_at_least_as_extreme(n):
    rng = np.random.default_rng(n)
    a, b = rng.normal(0.5, 1, n), rng.normal(size=n)
    signs = np.array(list(itertools.product((1, -1), repeat=n)))
    means = signs @ (a - b) / n
    low = np.mean(means <= np.mean(a - b) + 1e-12)
    high = np.mean(means >= np.mean(a - b) - 1e-12)
    assert paired_p(a, b) == pytest.approx(min(2 * min(low, high), 1.0))


def test_beyond_the_exact_pairs_the_random_exchanges_agree():
    """Of a standard normal mean over n pairs, about 2 (1 - Phi(z))."""
    rng = np.random.default_rng(0)
    a = rng.normal(0.4, 1, 30)
    signs = rng.choice([-1, 1], (200_000, 30))
    expected = np.mean(np.abs(signs @ a) >= abs(a.sum()))
    assert paired_p(a, np.zeros(30)) == pytest.approx(expected, abs=0.003)


def test_four_seeds_cannot_give_less_than_one_eighth():
    assert paired_p(np.array([1.0, 2.0, 3.0, 4.0]), np.zeros(4)) == pytest.approx(1 / 8)


def test_equal_cases_are_not_different():
    assert paired_p(np.ones(5), np.ones(5)) == 1.0


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.9, 0.8]) == pytest.approx([1.0, 1.0])
    assert holm([]) == []


def test_probability_of_superiority_counts_ties_half():
    assert probability_of_superiority(np.array([1.0, 2.0]), np.array([1.0, 0.0])) == pytest.approx(0.875)


def test_compare_uses_common_seeds():
    summary = pd.DataFrame(
        {"case": ["a"] * 5 + ["b"] * 4, "seed": [0, 1, 2, 3, 4, 0, 1, 2, 3], "score": [5, 6, 7, 8, 99, 1, 2, 3, 5]}
    )
    (row,) = compare(summary, [("a", "b")], "score")
    assert (row.seeds, row.difference, row.wins) == (4, 3.75, 31 / 32)
    assert row.p == pytest.approx(1 / 8)


def test_pairs_asked_together_are_one_family():
    summary = pd.DataFrame(
        {"case": case, "seed": seed, "score": seed + bonus} for case, bonus in {"a": 2.0, "b": 1.0, "c": 0.0}.items()
        for seed in range(4)
    )  # fmt: skip
    assert [row.p for row in compare(summary, [("a", "b"), ("b", "c")], "score")] == pytest.approx([1 / 4, 1 / 4])
