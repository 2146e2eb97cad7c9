"""The dual: its optimum, its invariances and its edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.optimize import minimize_scalar

from tltlrl.learning.reps import solve_dual

RETURNS = arrays(np.float64, st.integers(3, 40), elements=st.floats(-1e3, 1e3, width=32))


def dual(log_eta, returns, epsilon):
    """g(eta) as in the module's docstring, word for word."""
    eta, best = np.exp(log_eta), returns.max()
    return eta * epsilon + best + eta * np.log(np.mean(np.exp((returns - best) / eta)))


@pytest.mark.parametrize("epsilon", [0.01, 0.1, 0.5, 1.0, 2.0])
def test_eta_minimises_the_dual_as_written(epsilon):
    returns = np.random.default_rng(1).normal(size=30)
    found = minimize_scalar(lambda x: dual(x, returns, epsilon), bounds=(-10, 10), options={"xatol": 1e-12})
    weighting = solve_dual(returns, epsilon)
    assert dual(np.log(weighting.eta), returns, epsilon) <= found.fun + 1e-12
    np.testing.assert_allclose(np.log(weighting.eta), found.x, atol=1e-5)
    expected = np.exp((returns - returns.max()) / weighting.eta)
    np.testing.assert_allclose(weighting.weights, expected / expected.sum(), rtol=1e-9)


@given(RETURNS, st.floats(0.01, 3.0))
def test_the_bound_holds_and_binds_unless_the_best_samples_share_everything(returns, epsilon):
    weighting = solve_dual(returns, epsilon)
    weights = weighting.weights
    assert np.isclose(weights.sum(), 1.0)
    assert (weights >= 0).all()
    positive = weights[weights > 0]
    kl = np.sum(positive * np.log(positive * len(returns)))
    np.testing.assert_allclose(kl, weighting.kl, atol=1e-9)
    assert kl <= epsilon + 1e-8
    if weighting.eta not in (0.0, np.inf):
        np.testing.assert_allclose(kl, epsilon, atol=1e-8)
    if weighting.eta == 0.0:
        best = returns == returns.max()
        np.testing.assert_allclose(weights, best / best.sum())


@given(RETURNS, st.sampled_from([0.1, 0.5, 1.0]))
def test_a_better_return_never_weighs_less(returns, epsilon):
    order = np.argsort(returns)
    weights = solve_dual(returns, epsilon).weights[order]
    assert (np.diff(weights) >= -1e-12).all()


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1.0, 1e3, 1e9])
@pytest.mark.parametrize("shift", [-1e9, -1.0, 0.0, 1e-9, 1.0, 1e9])
def test_scale_and_shift_leave_the_weights(scale, shift):
    returns = np.random.default_rng(2).integers(-1000, 1000, size=30).astype(float)
    reference = solve_dual(returns, 0.5)
    # The shift is measured in the scale's own unit, so that the sum keeps the digits of the returns.
    moved = solve_dual(scale * (returns + shift), 0.5)
    np.testing.assert_allclose(moved.weights, reference.weights, atol=1e-8)
    np.testing.assert_allclose(moved.eta, reference.eta * scale, rtol=1e-6)


def test_equal_returns_weigh_the_same_and_the_temperature_says_so():
    for value in (0.0, 3.0, -1e300):
        weighting = solve_dual(np.full(7, value), 0.5)
        np.testing.assert_array_equal(weighting.weights, np.full(7, 1 / 7))
        assert weighting.eta == np.inf
        assert weighting.kl == 0.0
        np.testing.assert_allclose(weighting.effective_sample_size, 7.0)


def test_one_dominating_sample_is_held_back_by_the_bound():
    weighting = solve_dual(np.array([0.0] * 29 + [1e12]), 0.5)
    np.testing.assert_allclose(weighting.kl, 0.5, atol=1e-8)
    assert weighting.weights[-1] < 0.6
    np.testing.assert_allclose(weighting.weights[:-1], weighting.weights[0])


def test_ties_at_the_top_share_the_weight_where_the_bound_does_not_bind():
    weighting = solve_dual(np.array([1.0, 1.0, 1.0, 0.0]), 0.5)  # KL of the three is log(4/3) = 0.29
    np.testing.assert_allclose(weighting.weights, [1 / 3, 1 / 3, 1 / 3, 0.0])
    assert weighting.eta == 0.0


def test_huge_and_tiny_returns_do_not_overflow():
    np.testing.assert_allclose(solve_dual(np.array([1e308, -1e308, 0.0, 0.0]), 0.5).kl, 0.5, atol=1e-8)
    np.testing.assert_allclose(solve_dual(np.array([1e-308, -1e-308, 0.0, 0.0]), 0.5).kl, 0.5, atol=1e-8)


def test_minus_infinity_is_a_sample_that_cannot_be_worse():
    with_it = solve_dual(np.array([-np.inf, 0.0, 1.0, 2.0, 3.0]), 0.5)
    without = solve_dual(np.array([0.0, 1.0, 2.0, 3.0]), 0.5)
    assert with_it.weights[0] == 0.0
    np.testing.assert_allclose(with_it.weights[1:], without.weights)


@pytest.mark.parametrize(
    ("returns", "message"),
    [
        ([0.0, np.nan, 1.0], r"returns of samples \[1\] are NaN or \+inf"),
        ([0.0, 1.0, np.inf], r"returns of samples \[2\] are NaN or \+inf"),
        ([-np.inf, -np.inf], "every return is -inf"),
    ],
)
def test_what_cannot_be_learned_from_is_told(returns, message):
    with pytest.raises(ValueError, match=message):
        solve_dual(np.array(returns), 0.5)


def test_epsilon_must_be_positive():
    with pytest.raises(ValueError, match="epsilon must be positive"):
        solve_dual(np.arange(3.0), 0.0)


def test_leading_axes_are_problems_of_their_own():
    rng = np.random.default_rng(3)
    returns = rng.normal(size=(50, 20)) * rng.lognormal(0, 5, size=(50, 1))
    returns[7] = 1.0
    together = solve_dual(returns, 0.7)
    for t in range(50):
        alone = solve_dual(returns[t], 0.7)
        np.testing.assert_allclose(together.weights[t], alone.weights, atol=1e-8)
        np.testing.assert_allclose(together.eta[t], alone.eta, rtol=1e-6)


def test_effective_sample_size_is_near_the_published_table():
    """shared measurements, mean over draws: N = 20, eps 0.5 gives 8.6; N = 30, eps 1.0 gives 6.7."""
    rng = np.random.default_rng(4)
    for n, epsilon, expected in [(10, 0.5, 4.6), (20, 0.5, 8.6), (20, 1.0, 4.7), (30, 1.0, 6.7)]:
        size = solve_dual(rng.normal(size=(500, n)), epsilon).effective_sample_size.mean()
        assert abs(size - expected) < 0.25, (n, epsilon, size)
