"""Shortcuts: what each of them keeps, and that it is what its definition says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tltlrl.training.shortcuts import at_rest_from, cost, shortcuts, smoothed, spans, stretched, together


def motion(seed, steps=40, joints=2):
    return np.random.default_rng(seed).uniform(-1, 1, (steps, joints))


def padded(speeds, before, after):
    return np.vstack([before, speeds, after])


@given(st.integers(0, 99), st.integers(1, 30), st.floats(2, 300))
def test_a_smoothed_piece_is_the_minimiser_that_its_docstring_names(seed, steps, width):
    piece, (before, after) = motion(seed, steps), motion(seed + 1, 2)
    found = smoothed(piece, before, after, width)
    path = np.cumsum(np.vstack([np.zeros(2), piece]), axis=0)
    rows = np.diff(np.eye(steps + 3), n=2, axis=0)  # second differences of the path and one point beyond each end
    fixed = np.vstack([path[0] - before, path, path[-1] + after])
    inner = slice(2, steps + 1)
    weight = (width / (2 * np.pi)) ** 2
    rest = fixed.copy()
    rest[inner] = 0
    matrix = np.vstack([weight * rows[:, inner], np.eye(steps - 1)])
    wanted = np.vstack([-weight * rows @ rest, path[1:-1]])
    expected = fixed.copy()
    expected[inner] = np.linalg.lstsq(matrix, wanted)[0]
    np.testing.assert_allclose(found, np.diff(expected[1:-1], axis=0), atol=1e-6)


@given(st.integers(0, 99), st.integers(1, 30))
def test_a_stretched_motion_goes_the_same_way(seed, steps):
    speeds = motion(seed, 10)
    assert stretched(speeds, steps).shape == (steps, 2)
    np.testing.assert_allclose(stretched(speeds, steps).sum(axis=0), speeds.sum(axis=0), atol=1e-12)
    np.testing.assert_allclose(stretched(speeds, 10), speeds, atol=1e-12)
    np.testing.assert_allclose(stretched(speeds, 20), np.repeat(speeds / 2, 2, axis=0), atol=1e-12)


def test_coming_to_rest():
    speeds = np.full((6, 1), 3.0)
    assert at_rest_from(speeds, 2, 2)[:, 0] == pytest.approx([3, 3, 2, 1, 0, 0])
    assert at_rest_from(speeds, 5, 2)[:, 0] == pytest.approx([3, 3, 3, 3, 3, 2])
    assert not at_rest_from(speeds, 0, 2).any()


def test_events_that_are_near_are_one():
    assert spans([], 90) == [(-1, -1), (90, 90)]
    assert spans([0, 10, 13, 16, 20], 90) == [(-1, -1), (0, 0), (10, 16), (20, 20), (90, 90)]


def test_shortcuts_beside_an_event_leave_it_whole_or_shift_it():
    """A short peak of speed costs most; shortcuts that do not know of it (no events: 0.27 whole, 3 places) break it."""
    speeds = np.concatenate([motion(1, 40) / 9, np.full((2, 2), 0.9), motion(2, 40) / 9])
    found = shortcuts(speeds, [40, 42], -np.ones(2), np.ones(2), 0.01, 200, np.random.default_rng(0))
    peaks = [np.flatnonzero(np.all(np.abs(shortcut.speeds - 0.9) < 1e-9, axis=1)) for shortcut in found]
    whole = [tuple(peak) for peak in peaks if len(peak) == 2]
    assert len(whole) > 0.45 * len(found)
    assert len(set(whole)) > 8


def test_cost_counts_from_rest_to_rest():
    assert cost(np.array([[1.0], [3.0]]), 0.5) == 1 + 4 + 9 + 0.5 * (1 + 9)


@given(st.integers(0, 99), st.integers(3, 60), st.sets(st.integers(1, 59)))
def test_shortcuts_are_cheaper_within_limits_and_change_their_piece_alone(seed, steps, events):
    speeds, low, high = motion(seed, steps), np.array([-1.0, -np.inf]), np.ones(2)
    events = sorted(step for step in events if step < steps)
    found = shortcuts(speeds, events, low, high, 0.01, 20, np.random.default_rng(seed))
    assert 0 < len(found) <= 20
    for shortcut in found:
        assert shortcut.cost == cost(shortcut.speeds, 0.01) < cost(speeds, 0.01)
        assert np.all((shortcut.speeds >= low) & (shortcut.speeds <= high))
        changed = np.flatnonzero(np.any(shortcut.speeds != speeds, axis=1))
        assert changed.min() >= shortcut.first
        assert changed.max() < shortcut.end
        if shortcut.end < steps:  # it ends where it did
            np.testing.assert_allclose(shortcut.speeds.sum(axis=0), speeds.sum(axis=0), atol=1e-6)


def test_the_same_generator_gives_the_same_shortcuts_and_rest_has_none():
    one, two = (
        shortcuts(motion(0), [9], -np.ones(2), np.ones(2), 0.01, 20, np.random.default_rng(3)) for _ in range(2)
    )  # fmt: skip
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.speeds, b.speeds)
    assert shortcuts(np.zeros((9, 2)), [], -np.ones(2), np.ones(2), 0.01, 20, np.random.default_rng(3)) == []


def test_only_shortcuts_that_do_not_overlap_go_together():
    speeds = motion(0)
    found = shortcuts(speeds, [], -np.ones(2), np.ones(2), 0.01, 20, np.random.default_rng(1))
    result, taken = together(found, speeds), []
    for shortcut in found:
        steps = set(range(shortcut.first, shortcut.end))
        if not any(steps & other for other in taken):
            taken.append(steps)
            np.testing.assert_array_equal(result[shortcut.first : shortcut.end], shortcut.speeds[sorted(steps)])
    free = sorted(set(range(40)) - set.union(*taken))
    np.testing.assert_array_equal(result[free], speeds[free])
