"""The telescoped robustness."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import batches, formulas
from test_monitor import DECLARED

from tltlrl.logic import load_spec, parse_spec, telescope
from tltlrl.logic.online.potential import FLOOR, hope, stages

SPECS = Path(__file__).parents[3] / "specs"


@given(formulas(), batches(), st.sampled_from([hope, stages]))
@settings(deadline=None, max_examples=60)
def test_the_rewards_sum_to_the_robustness(formula, batch, phi):
    """Of trajectories of any length, an infinite robustness as FLOOR."""
    spec, (signals, lengths) = parse_spec(DECLARED + str(formula)), batch
    robustness = spec.robustness(signals, lengths)
    rewards = telescope(spec, signals, lengths, phi)
    assert rewards.shape == signals["x"].shape
    assert np.isfinite(rewards).all()
    expected = np.where(np.isfinite(robustness), robustness, np.sign(robustness) * FLOOR)
    np.testing.assert_allclose(rewards.sum(axis=1), expected, rtol=0, atol=1e-12)
    for row, length in enumerate(lengths):
        assert not rewards[row, length:].any()


def phis(text, **signals):
    monitor = parse_spec(text).monitor()
    found = []
    for values in zip(*signals.values(), strict=True):
        found.append(stages(monitor, monitor.update(dict(zip(signals, values, strict=True))))[0])
    return found


def test_the_potential_rises_towards_each_goal_and_never_drops_when_one_is_reached():
    x = [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0, -1.0, -2.0]
    found = phis("(x > 2.5) T (x < -1.5)", x=x)
    rising = np.diff(found)
    assert (rising >= 0).all()
    assert rising[1] > 0  # nearer to the first goal
    assert rising[5] > 0  # nearer to the second
    assert found[-1] == 0.5


def test_a_violation_lowers_the_potential_at_its_step():
    found = phis("F (x > 9) & G (y > 0)", x=[0.0] * 4, y=[1.0, 1.0, -1.0, 1.0])
    assert found[1] > found[2]
    assert found[0] == found[1]
    assert found[2] == found[3]


def test_hope_falls_at_the_step_that_spoils_something_and_at_no_other():
    spec = parse_spec("F (x > 9) & G (y > 0)")
    rewards = telescope(spec, {"x": np.array([[1.0, 2, 3, 12]]), "y": np.array([[2.0, 1, -1, 3]])})
    assert rewards.tolist() == [[0.0, 0.0, -1.0, 0.0]]


@pytest.mark.parametrize("phi", [lambda m, _: np.zeros(m.count), lambda _, r: r.robustness.clip(-1, 1), stages])
def test_any_potential_gives_the_same_sum(phi):
    spec, x = parse_spec("F (x > 1) & G (x < 2)"), np.random.default_rng(0).normal(size=(5, 20))
    np.testing.assert_allclose(telescope(spec, {"x": x}, phi=phi).sum(axis=1), spec.robustness({"x": x}), atol=1e-12)


def test_the_arms_task():
    spec = load_spec(SPECS / "visit_in_order.tltl")
    ee = np.cumsum(np.random.default_rng(0).normal(size=(6, 50, 2)) * 0.2, axis=1)
    rewards = telescope(spec, {"ee": ee})
    np.testing.assert_allclose(rewards.sum(axis=1), spec.robustness({"ee": ee}), rtol=0, atol=1e-12)
