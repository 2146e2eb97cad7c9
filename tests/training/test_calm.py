"""Proposals of calm motions against what they are by definition."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tltlrl.training.calm import SPEED, bridged, candidates, cost, floor, propose, resting, smoothed


def commands(seed, steps=30, d=2):
    return np.random.default_rng(seed).uniform(-0.8, 0.8, (steps, d))


@given(st.integers(0, 50), st.integers(2, 60))
@settings(max_examples=25, deadline=None)
def test_proposals_cost_less_keep_the_limits_and_repeat(seed, steps):
    now, low, high = commands(seed, steps), -np.ones(2), np.ones(2)
    proposals, spans = propose(now, low, high, 5, np.random.default_rng(seed))
    assert len(proposals) == len(spans) <= 5
    assert (cost(proposals) < cost(now)).all()
    assert (np.abs(proposals) <= 1 + 1e-9).all()
    assert all(0 <= first < end <= steps for first, end in spans)
    np.testing.assert_array_equal(proposals, propose(now, low, high, 5, np.random.default_rng(seed))[0])


def test_what_is_at_rest_already_cannot_be_made_calmer():
    proposals, spans = propose(np.zeros((30, 2)), -np.ones(2), np.ones(2), 5, np.random.default_rng(0))
    assert proposals.shape == (0, 30, 2)
    assert spans == []


@pytest.mark.parametrize(("first", "end"), [(0, 30), (0, 7), (4, 19), (25, 30), (3, 4)])
def test_a_bridge_leads_to_the_same_place_and_changes_nothing_else(first, end):
    now = commands(1)
    new = bridged(now, first, end)
    np.testing.assert_allclose(new[first:end].sum(axis=0), now[first:end].sum(axis=0))
    np.testing.assert_array_equal(np.delete(new, slice(first, end), axis=0), np.delete(now, slice(first, end), axis=0))
    assert np.abs(np.diff(new[first:end], n=3, axis=0)).max(initial=0) < 1e-9  # a parabola


def test_the_floor_sinks_to_the_share_and_stays_there():
    floors = [floor(0.5, 0.7, batch, 10) for batch in range(10)]
    assert np.all(np.diff(floors[:7]) < 0)
    assert floors[6:] == pytest.approx([0.35] * 4)
    assert floors[0] < 0.5


def test_rest_is_reached_within_its_steps():
    now = commands(2)
    new = resting(now, 10, 3)
    np.testing.assert_allclose(new[10:13], np.outer([0.75, 0.5, 0.25], now[9]))
    np.testing.assert_array_equal(new[13:], 0)
    np.testing.assert_array_equal(new[:10], now[:10])
    assert not resting(now, 0, 5).any()


@pytest.mark.parametrize(("first", "end"), [(0, 30), (5, 20), (28, 30)])
def test_smoothing_is_the_least_squares_that_it_says(first, end):
    """Against numpy's solver of the stacked differences."""
    now, inside, outside = commands(3), 1e-4, 0.5
    weights = np.full(30, outside)
    weights[first : end - 1] = inside
    reach = np.tril(np.ones((30, 30)))
    change = np.eye(30) - np.eye(30, k=-1)  # from rest
    stacked = np.concatenate([change, np.sqrt(SPEED) * np.eye(30), np.sqrt(weights)[:, None] * reach])
    wanted = np.concatenate([np.zeros((60, 2)), np.sqrt(weights)[:, None] * (reach @ now)])
    expected = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
    np.testing.assert_allclose(smoothed(now, first, end, inside, outside), expected, atol=1e-4)


def test_replacements_in_disjoint_spans_are_tried_together_first():
    now = np.zeros((9, 1))
    a, b, c = (np.zeros((9, 1)) for _ in range(3))
    a[1:3], b[2:5], c[6:8] = 0.3, 0.4, 0.5
    together, alone = candidates(now, np.array([a, b, c]), [(1, 3), (2, 5), (6, 8)], -np.ones(1), np.ones(1))
    np.testing.assert_array_equal(together, a + c)
    np.testing.assert_array_equal(alone, a)
    assert candidates(now, np.zeros((0, 9, 1)), [], -np.ones(1), np.ones(1)) == []
