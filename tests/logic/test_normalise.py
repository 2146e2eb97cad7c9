"""Predicates brought to one scale: verdicts stay, units do not matter."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import DECLARED, batches, formulas

from tltlrl.logic import parse_spec

UNITS = st.floats(-3, 3).map(lambda exponent: 10.0**exponent)


@settings(deadline=None)
@given(formulas(), batches())
def test_every_verdict_stays(formula, batch):
    signals, lengths = batch
    spec = parse_spec(DECLARED + str(formula))
    normalised = spec.normalised(signals, lengths).robustness(signals, lengths)
    np.testing.assert_array_equal(np.sign(normalised), np.sign(spec.robustness(signals, lengths)))


def text(c, d):
    """One formula, its predicates in the units c and d."""
    return (
        "signal x\nsignal y\nconst centre[a] = -1\nconst centre[b] = 2\n"
        f"def near[i in a, b]: {c!r} * abs(x - centre[i]) < {c!r} * 0.7\n"
        f"spec: F near[a] & G (near[b] => X[!] {d!r} * y < {d!r} * 0.5) & (y < 2 U near[b])"
    )


@given(UNITS, UNITS, st.integers(0, 2**32 - 1))
def test_the_units_of_the_predicates_do_not_matter(c, d, seed):
    rng = np.random.default_rng(seed)
    signals = {name: np.cumsum(rng.normal(size=(6, 12)), axis=1) for name in "xy"}
    plain, other = (parse_spec(text(*units)).normalised(signals) for units in ((1.0, 1.0), (c, d)))
    np.testing.assert_allclose(other.robustness(signals), plain.robustness(signals), rtol=1e-9)
    for one, two in zip(plain.clauses(signals).values(), other.clauses(signals).values(), strict=True):
        np.testing.assert_allclose(two, one, rtol=1e-9)


def test_the_scale_is_the_standard_deviation_of_a_predicate_and_one_for_a_family():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 5, 8))
    lengths = [8, 3, 8, 5, 8]
    seen = np.arange(8) < np.array(lengths)[:, None]
    spec = parse_spec(
        "signal x\nsignal y\ndef high[i in a, b]: x > c[i]\nconst c[a] = 0\nconst c[b] = 9\nspec: G y < 7"
    )
    values = spec.normalised({"x": x, "y": y}, lengths).robustness({"x": x, "y": y}, lengths)
    expected = np.min(np.where(seen, 7 - y, np.inf), axis=1) / np.std(y[seen])
    np.testing.assert_allclose(values, expected)
    family = parse_spec(
        "signal x\nconst c[a] = 1\nconst c[b] = 3\ndef low[i in a, b]: c[i] * x < 1\nspec: all i in a, b: G low[i]"
    )
    values = family.normalised({"x": x, "y": y}).robustness({"x": x, "y": y})
    spread = np.sqrt((1 + 9) / 2) * np.std(x)
    np.testing.assert_allclose(values, np.minimum(1 - x, 1 - 3 * x).min(axis=1) / spread)


@given(UNITS, st.sampled_from([0.0, 1e-17]), st.integers(0, 2**32 - 1))
def test_the_unit_of_a_predicate_that_never_changes_does_not_matter_either(c, jitter, seed):
    """It may change later: then it counts in shares of what its margin was, and not of its rounding errors."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(4, 6))
    still = {"x": x, "y": 0.25 + jitter * rng.normal(size=x.shape)}
    moved = {"x": x, "y": 0.25 + rng.normal(size=x.shape)}
    plain, other = (
        parse_spec(f"signal x\nsignal y\nspec: F x > 0 & G {unit!r} * y < {unit!r} * 3").normalised(still)
        for unit in (1.0, c)
    )
    np.testing.assert_allclose(other.robustness(moved), plain.robustness(moved), rtol=1e-9)
    np.testing.assert_allclose(other.robustness(still), plain.robustness(still), rtol=1e-9)
    assert np.all(plain.robustness(still) <= 1)


def test_a_predicate_that_never_changes_is_divided_by_its_margin():
    signals = {"x": np.ones((4, 5))}
    for formula, value in (("G x < 3", 1.0), ("G x > 3", -1.0), ("G x < 1", 0.0)):
        spec = parse_spec(f"signal x\nspec: {formula}").normalised(signals)
        np.testing.assert_array_equal(spec.robustness(signals), value)
