"""Proposes calmer motions, by shortcuts as in motion planning (Geraerts and Overmars 2007, OMPL).

A motion is given by the speeds of its joints at T steps; it begins and ends at rest. A shortcut changes a piece
[first, end) of it; before and after the piece, joint path and speeds stay the same. There are four kinds:

- smooth: waves of the joint path that are shorter than some width are removed;
- through: a point of the joint path, or one near it, is passed at some speed, and the way to and from it is smooth;
- shift: the middle of the piece happens earlier or later, and the rest of it faster or slower, and smooth;
- rest: the robot stops, and stays at rest to the end.

Half of the pieces lie anywhere. The others know the events of the motion, that is the steps at which a predicate of the
spec becomes true or false: what lies between two events becomes smooth, or an event is shifted between its neighbours.

Speeds are shares of full speed, so that no joint outweighs another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TRIES = 8  # per wanted proposal
SHORTEST = 4  # steps of a piece
LONGEST_FADE = 12  # most steps to come to rest
REST = 0.4  # share of the last pieces that come to rest
PART, ONE_JOINT = 0.3, 0.3  # shares of the shortcuts that are applied only in part, and only to one joint
NEAR = 4  # steps: events that are nearer are one event, and the pieces beside an event begin or end so near to it
MIDDLE = 8  # most steps before and after an event that are shifted with it


@dataclass(frozen=True)
class Shortcut:
    """A change of a motion.

    Attributes:
      first, end: the steps [first, end) that it changes.
      speeds: speeds of the whole changed motion, shape (T, j).
      cost: cost of the changed motion.
    """

    first: int
    end: int
    speeds: Array
    cost: float


def cost(speeds: Array, straightness: float) -> float:
    """The sum of squared changes of speed, from rest to rest, plus the weighted sum of squared speeds.

    Args:
      speeds: shape (T, j).
      straightness: weight of the speeds, which makes paths short.
    """
    return float(_costs(speeds, straightness).sum() + np.sum(speeds[-1] ** 2))


def _costs(speeds: Array, straightness: float) -> Array:
    """The cost of each step, shape (T,), without the stop after the last."""
    return np.asarray(np.sum(np.diff(speeds, axis=0, prepend=0.0) ** 2 + straightness * speeds**2, axis=1))


def shortcuts(
    speeds: Array,
    events: Sequence[int],
    low: Array,
    high: Array,
    straightness: float,
    count: int,
    rng: np.random.Generator,
) -> list[Shortcut]:
    """At most `count` shortcuts that cost less than the motion and stay within its limits.

    Args:
      speeds: shape (T, j).
      events: steps at which a predicate becomes true or false, rising.
      low, high: limits of the speeds, shapes (j,); infinite where there are none.
      straightness: see `cost`.
      count: how many are wanted.
      rng: source of all choices.
    """
    before, costs = cost(speeds, straightness), _costs(speeds, straightness)
    if before == 0:
        return []
    # Half of them where the motion costs most, half anywhere.
    chances = 0.5 * costs / costs.sum() + 0.5 / len(costs)
    between = spans(events, len(speeds))
    found: list[Shortcut] = []
    for about in rng.choice(len(speeds), TRIES * count, p=chances):
        shortcut = _shortcut(speeds, about, between, straightness, rng)
        within = np.all((shortcut.speeds >= low) & (shortcut.speeds <= high))
        if within and shortcut.cost < before:
            found.append(shortcut)
            if len(found) == count:
                break
    return found


def _shortcut(
    speeds: Array, about: int, events: list[tuple[int, int]], straightness: float, rng: np.random.Generator
) -> Shortcut:
    """One shortcut of any kind: beside an event, or of a piece that contains the step `about`."""
    beside = _beside_an_event(speeds, events, rng) if rng.random() < 0.5 else None
    first, piece = beside or _anywhere(speeds, about, rng)
    end = first + len(piece)
    difference = np.zeros_like(speeds)
    difference[first:end] = piece - speeds[first:end]
    if rng.random() < PART:
        difference *= rng.random()
    if rng.random() < ONE_JOINT:
        difference *= np.arange(speeds.shape[1]) == rng.integers(speeds.shape[1])
    changed = speeds + difference
    return Shortcut(first, end, changed, cost(changed, straightness))


def _anywhere(speeds: Array, about: int, rng: np.random.Generator) -> tuple[int, Array]:
    """A changed piece that contains a step: its first step and its new speeds."""
    steps = len(speeds)
    length = int(SHORTEST * (steps / SHORTEST) ** rng.random())
    first = about - int(rng.integers(length + 1))
    first, end = max(first, 0), min(first + length, steps)
    if end == steps and rng.random() < REST:
        return first, at_rest_from(speeds, first, int(rng.integers(LONGEST_FADE)))[first:]
    piece, (before, after) = speeds[first:end], _ends(speeds, first, end)
    kind = rng.integers(3)
    if kind == 0:
        return first, smoothed(piece, before, after, _width(length, rng))
    if kind == 1:
        return first, _through(piece, before, after, min(about, end) - first, rng)
    if len(piece) < 3:
        return first, piece
    a, b = sorted(1 + rng.choice(len(piece) - 1, 2, replace=False))
    return first, _shift(piece, before, after, a, b, rng)


def spans(events: Sequence[int], steps: int) -> list[tuple[int, int]]:
    """First and last step of each event, with those that are near each other as one, between start and end.

    Args:
      events: steps, rising.
      steps: of the motion.
    """
    found = [(-1, -1)]
    for step in events:
        near = len(found) > 1 and step - found[-1][1] < NEAR
        found = [*found[:-1], (found[-1][0], step)] if near else [*found, (step, step)]
    return [*found, (steps, steps)]


def _beside_an_event(
    speeds: Array, events: list[tuple[int, int]], rng: np.random.Generator
) -> tuple[int, Array] | None:
    """A changed piece between two events, or with an event in its middle; None if it is too short.

    Args:
      speeds: shape (T, j).
      events: from `spans`.
      rng: source of all choices.
    """
    around = len(events) > 2 and rng.random() < 0.5
    left = int(rng.integers(len(events) - 1 - around))
    first = max(events[left][1] + int(rng.integers(NEAR)), 0)
    end = min(events[left + 1 + around][0] - int(rng.integers(NEAR)), len(speeds))
    if end - first < SHORTEST:
        return None
    piece, (before, after) = speeds[first:end], _ends(speeds, first, end)
    if not around:
        return first, smoothed(piece, before, after, _width(len(piece), rng))
    a, b = events[left + 1] + rng.integers(1, MIDDLE + 1, 2) * (-1, 1) - first
    if a < 1 or b >= len(piece):
        return None
    return first, _shift(piece, before, after, a, b, rng)


def _ends(speeds: Array, first: int, end: int) -> tuple[Array, Array]:
    """The speeds before and after a piece; the motion begins and ends at rest."""
    rest = np.zeros(speeds.shape[1])
    return speeds[first - 1] if first else rest, speeds[end] if end < len(speeds) else rest


def _width(length: int, rng: np.random.Generator) -> float:
    """The width of a smoothing, steps: from two steps to far beyond the piece, where it becomes a cubic."""
    return float(2.0 * (5 * length) ** rng.random())


def _through(piece: Array, before: Array, after: Array, at: int, rng: np.random.Generator) -> Array:
    """The piece on a smooth way through a point of the path, or near it, at about the speed before or after it."""
    to, on = piece[:at], piece[at:]
    if not len(to) or not len(on):
        return piece
    speed = (to[-1], on[0])[rng.integers(2)] * rng.uniform(0.5, 1.2)
    if rng.random() < 0.5:
        moved = rng.standard_normal(piece.shape[1]) * np.sqrt(np.mean(piece**2))
        to, on = to + moved / len(to), on - moved / len(on)
    width = 10.0 * len(piece)
    return np.concatenate([smoothed(to, before, speed, width), smoothed(on, speed, after, width)])


def _shift(piece: Array, before: Array, after: Array, a: int, b: int, rng: np.random.Generator) -> Array:
    """The piece with its middle [a, b) earlier or later, half of the time by a few steps only."""
    most = MIDDLE if rng.random() < 0.5 else len(piece)
    later = int(rng.integers(-min(a // 2, most), min((len(piece) - b) // 2, most) + 1))
    to, middle, on = stretched(piece[:a], a + later), piece[a:b], stretched(piece[b:], len(piece) - b - later)
    width = _width(len(piece), rng)  # smooth, since the speed would jump at both ends of the middle otherwise
    return np.concatenate([smoothed(to, before, middle[0], width), middle, smoothed(on, middle[-1], after, width)])


def stretched(speeds: Array, steps: int) -> Array:
    """Speeds along the same joint path in another number of steps, shape (T, j) => (steps, j)."""
    path = np.vstack([np.zeros(speeds.shape[1]), np.cumsum(speeds, axis=0)])
    times = np.linspace(0, len(speeds), steps + 1)
    return np.diff([np.interp(times, np.arange(len(path)), joint) for joint in path.T], axis=1).T


def smoothed(piece: Array, before: Array, after: Array, width: float) -> Array:
    """A piece of a motion without waves of its joint path shorter than `width` steps.

    The new path minimises lambda sum (second differences)^2 + sum (change of q)^2 with lambda = (width / 2 pi)^4. Its
    ends stay. The larger the width, the closer the path to a cubic.

    Args:
      piece: speeds, shape (n, j).
      before, after: speeds at its ends, shapes (j,).
      width: steps.
    """
    from scipy.linalg import solveh_banded  # slow to import; a run that is not made calm does without

    bends = np.diff(np.vstack([before, piece, after]), n=3, axis=0)  # D' D q of the inner points, D second differences
    if not len(bends):
        return piece
    bands = np.tile([[1.0], [-4.0], [6.0 + (2 * np.pi / width) ** 4]], len(bends))
    shift = np.pad(-solveh_banded(bands, bends), ((1, 1), (0, 0)))  # change of the path's points; its ends stay
    return np.asarray(piece + np.diff(shift, axis=0))


def at_rest_from(speeds: Array, step: int, fade: int) -> Array:
    """A motion that is the same until a step, then slows down evenly for `fade` steps, and rests.

    Args:
      speeds: shape (T, j).
      step: the first step that changes.
      fade: how many steps it takes to come to rest.
    """
    result = speeds.copy()
    result[step:] = 0.0
    slowing = result[step : step + fade]
    if step:
        slowing += speeds[step - 1] * (1 - np.arange(1, len(slowing) + 1) / (fade + 1))[:, None]
    return result


def together(shortcuts: list[Shortcut], speeds: Array) -> Array:
    """The motion with every shortcut in the list that overlaps none before it.

    Args:
      shortcuts: shortcuts of the same motion.
      speeds: speeds of that motion, shape (T, j).
    """
    result, taken = speeds.copy(), np.zeros(len(speeds), dtype=bool)
    for shortcut in shortcuts:
        piece = slice(shortcut.first, shortcut.end)
        if not taken[piece].any():
            result[piece], taken[piece] = shortcut.speeds[piece], True
    return result
