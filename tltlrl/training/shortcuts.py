"""Proposals of calmer motions, in the manner of the shortcuts of motion planners (Geraerts and Overmars 2007, OMPL).

A motion is the speeds of its joints at T steps; it begins and ends at rest. A shortcut changes a piece [first, end) of
it, and joint path and speeds before and after the piece stay as they were. It is one of four:

- smooth: waves of the joint path that are shorter than some width are taken out;
- through: one point of the joint path is passed at some speed, or moved, and the way to it and from it is smooth;
- shift: what lies in the middle of the piece happens earlier or later, what lies before and after it faster or slower;
- rest: the robot stops, and stays to the end.

Speeds are shares of full ones here, so that no joint outweighs another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

Array = NDArray[np.float64]

TRIES = 8  # per proposal that is wanted
SHORTEST = 4  # steps of a piece
LONGEST_FADE = 12  # steps to come to rest in
REST = 0.4  # share of the last pieces that come to rest
PART, ONE_JOINT = 0.3, 0.3  # shares of the shortcuts that are taken in part, and by one joint alone


@dataclass(frozen=True)
class Shortcut:
    """A change of a motion.

    Attributes:
      first, end: of the steps that it changes.
      speeds: of the whole motion with it, shape (T, j).
      cost: of that motion.
    """

    first: int
    end: int
    speeds: Array
    cost: float


def cost(speeds: Array, straightness: float) -> float:
    """Sum of the squared changes of speed, from rest to rest, and of the squared speeds, weighed.

    Args:
      speeds: shape (T, j).
      straightness: weight of the speeds, which makes paths short.
    """
    return float(_costs(speeds, straightness).sum() + np.sum(speeds[-1] ** 2))


def _costs(speeds: Array, straightness: float) -> Array:
    """Of each step, shape (T,); but for coming to rest after the last."""
    return np.asarray(np.sum(np.diff(speeds, axis=0, prepend=0.0) ** 2 + straightness * speeds**2, axis=1))


def shortcuts(
    speeds: Array, low: Array, high: Array, straightness: float, count: int, rng: np.random.Generator
) -> list[Shortcut]:
    """At most `count` shortcuts that cost less than the motion and stay within its limits.

    Args:
      speeds: shape (T, j).
      low, high: limits of the speeds, shapes (j,); infinite where there are none.
      straightness: see `cost`.
      count: how many are wanted.
      rng: what all choices come from.
    """
    before, costs = cost(speeds, straightness), _costs(speeds, straightness)
    if before == 0:
        return []
    # Half of them where the motion costs most, half anywhere.
    chances = 0.5 * costs / costs.sum() + 0.5 / len(costs)
    found: list[Shortcut] = []
    for about in rng.choice(len(speeds), TRIES * count, p=chances):
        shortcut = _shortcut(speeds, about, straightness, rng)
        within = np.all((shortcut.speeds >= low) & (shortcut.speeds <= high))
        if within and shortcut.cost < before:
            found.append(shortcut)
            if len(found) == count:
                break
    return found


def _shortcut(speeds: Array, about: int, straightness: float, rng: np.random.Generator) -> Shortcut:
    """One of any kind, of a piece in which the step `about` lies."""
    steps, joints = speeds.shape
    length = int(SHORTEST * (steps / SHORTEST) ** rng.random())
    first = about - int(rng.integers(length + 1))
    first, end = max(first, 0), min(first + length, steps)
    if end == steps and rng.random() < REST:
        changed = at_rest_from(speeds, first, int(rng.integers(LONGEST_FADE)))
    else:
        changed = speeds.copy()
        rest = np.zeros(joints)
        piece = speeds[first:end]
        before, after = speeds[first - 1] if first else rest, speeds[end] if end < steps else rest
        kind = rng.integers(3)
        if kind == 0:
            width = 2.0 * (5 * length) ** rng.random()  # from two steps to far beyond the piece: a cubic
            changed[first:end] = smoothed(piece, before, after, width)
        elif kind == 1:
            changed[first:end] = _through(piece, before, after, min(about, end) - first, rng)
        else:
            changed[first:end] = _shift(piece, rng)
    difference = changed - speeds
    if rng.random() < PART:
        difference *= rng.random()
    if rng.random() < ONE_JOINT:
        difference *= np.arange(joints) == rng.integers(joints)
    changed = speeds + difference
    return Shortcut(first, end, changed, cost(changed, straightness))


def _through(piece: Array, before: Array, after: Array, at: int, rng: np.random.Generator) -> Array:
    """By smooth ways through a point of the path, or one near it, at a speed like that before it or after it."""
    to, on = piece[:at], piece[at:]
    if not len(to) or not len(on):
        return piece
    speed = (to[-1], on[0])[rng.integers(2)] * rng.uniform(0.5, 1.2)
    if rng.random() < 0.5:
        moved = rng.standard_normal(piece.shape[1]) * np.sqrt(np.mean(piece**2))
        to, on = to + moved / len(to), on - moved / len(on)
    width = 10.0 * len(piece)
    return np.concatenate([smoothed(to, before, speed, width), smoothed(on, speed, after, width)])


def _shift(piece: Array, rng: np.random.Generator) -> Array:
    """The middle of a piece earlier or later."""
    if len(piece) < 2:
        return piece
    a, b = sorted(rng.integers(1, len(piece), 2))
    later = int(rng.integers(-(a // 2), (len(piece) - b) // 2 + 1))
    return np.concatenate([stretched(piece[:a], a + later), piece[a:b], stretched(piece[b:], len(piece) - b - later)])


def stretched(speeds: Array, steps: int) -> Array:
    """The same joint path in another number of steps; shape (T, j) => (steps, j)."""
    path = np.vstack([np.zeros(speeds.shape[1]), np.cumsum(speeds, axis=0)])
    times = np.linspace(0, len(speeds), steps + 1)
    return np.diff([np.interp(times, np.arange(len(path)), joint) for joint in path.T], axis=1).T


def smoothed(piece: Array, before: Array, after: Array, width: float) -> Array:
    """A piece of a motion with waves shorter than `width` steps smoothed out of its joint path.

    The path q becomes the one that minimises lambda sum (second differences)^2 + sum (change of q)^2, lambda =
    (width / 2 pi)^4, with its ends as they were; the wider, the closer to a cubic.

    Args:
      piece: speeds, shape (n, j).
      before, after: speeds at its ends, shapes (j,).
      width: steps.
    """
    bends = np.diff(np.vstack([before, piece, after]), n=3, axis=0)  # D' D q of the inner points, D second differences
    if not len(bends):
        return piece
    bands = np.tile([[1.0], [-4.0], [6.0 + (2 * np.pi / width) ** 4]], len(bends))
    shift = np.pad(-solveh_banded(bands, bends), ((1, 1), (0, 0)))  # of the path's points; its ends stay
    return np.asarray(piece + np.diff(shift, axis=0))


def at_rest_from(speeds: Array, step: int, fade: int) -> Array:
    """The motion until a step; then it slows down evenly for `fade` steps, and rests.

    Args:
      speeds: shape (T, j).
      step: the first that is changed.
      fade: steps.
    """
    result = speeds.copy()
    result[step:] = 0.0
    slowing = result[step : step + fade]
    if step:
        slowing += speeds[step - 1] * (1 - np.arange(1, len(slowing) + 1) / (fade + 1))[:, None]
    return result


def together(shortcuts: list[Shortcut], speeds: Array) -> Array:
    """The motion with every shortcut that overlaps none before it in the list.

    Args:
      shortcuts: of the same motion.
      speeds: of that motion, shape (T, j).
    """
    result, taken = speeds.copy(), np.zeros(len(speeds), dtype=bool)
    for shortcut in shortcuts:
        piece = slice(shortcut.first, shortcut.end)
        if not taken[piece].any():
            result[piece], taken[piece] = shortcut.speeds[piece], True
    return result
