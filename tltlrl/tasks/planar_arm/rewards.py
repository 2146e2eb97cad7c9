"""The hand-made rewards of the planar tasks, eqs 3.2 and 3.5 of the case study, on the regions of the spec."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.settings import check, setting
from tltlrl.tasks.task import Array, Memory, Signals, StepReward, required_constants


@dataclass(frozen=True)
class ReachAvoidReward:
    """Coefficients of eq. 3.2."""

    goal: float = setting("discrete reward of a sample at the goal", 5.0)
    obstacle: float = setting("discrete reward of a sample inside an obstacle", -2.0)
    c1: float = setting("price of a metre from the goal", 1.0)
    c2: float = setting("gain of a metre from each obstacle", 0.02)
    step: dict[str, float] = setting(
        "other values for step-based learners, from a grid search of its own", {"c2": 0.35}
    )

    def __post_init__(self) -> None:
        check(self, "reward")


@dataclass(frozen=True)
class VisitInOrderReward:
    """Coefficients of eq. 3.5."""

    goal: float = setting("discrete reward of entering the goal that is next", 5.0)
    wrong_order: float = setting("discrete reward of entering any other goal, visited before or too early", -5.0)
    obstacle: float = setting("discrete reward of a sample inside an obstacle", -2.0)
    c1: float = setting("price of a metre from the goal that is next", 1.0)
    c2: float = setting("gain of a metre from each of the other goals", 0.05)
    c3: float = setting("gain of a metre from each obstacle", 0.0)
    step: dict[str, float] = setting(
        "other values for step-based learners, from a grid search of its own", {"c2": 0.1, "c3": 0.1}
    )

    def __post_init__(self) -> None:
        check(self, "reward")


def reach_avoid_rewards(coefficients: ReachAvoidReward, constants: Mapping[str, Any]) -> dict[str, StepReward]:
    """The discrete and the continuous reward of eq. 3.2, on the regions of the spec.

    Args:
      coefficients: the coefficients of eq. 3.2.
      constants: the spec's: goal (x, y), goal_radius, obstacle and obstacle_radius (families), m.

    Raises:
      UserError: if the spec has no such constants.
    """
    goal, goal_radius = required_constants(constants, goal=tuple, goal_radius=float)
    obstacles = _obstacles(constants)

    def discrete(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        ee = signals["ee"]
        at = [_distance(ee, goal) <= goal_radius, _inside(ee, obstacles)]
        return np.select(at, [coefficients.goal, coefficients.obstacle], 0.0), memory

    def continuous(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        ee = signals["ee"]
        return -coefficients.c1 * _distance(ee, goal) + coefficients.c2 * _distances(ee, obstacles), memory

    return {"discrete": discrete, "continuous": continuous}


def visit_in_order_rewards(coefficients: VisitInOrderReward, constants: Mapping[str, Any]) -> dict[str, StepReward]:
    """The discrete and the continuous reward of eq. 3.5, on the regions of the spec.

    The state vector that the case study adds, which goals were visited, is `goals_visited`. A goal is visited at
    the sample that enters its disc; staying inside gives no reward. After the last goal there is no next one, and all
    goals are to be avoided.

    Args:
      coefficients: the coefficients of eq. 3.5.
      constants: the spec's: goal (a family, in the order of the visits), goal_radius, obstacle and obstacle_radius
        (families), m.

    Raises:
      UserError: if the spec has no such constants.
    """
    family, goal_radius = required_constants(constants, goal=dict, goal_radius=float)
    goals = [np.array(goal) for goal in family.values()]
    obstacles = _obstacles(constants)

    def discrete(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        ee = signals["ee"]
        inside = np.stack([_distance(ee, goal) <= goal_radius for goal in goals], axis=-1)  # (N, T, goals)
        count, was_inside = memory or (np.zeros(len(ee), dtype=np.int64), np.zeros_like(inside[:, 0]))
        visited = goals_visited(inside, count)
        entered = inside & ~np.concatenate([was_inside[:, None], inside[:, :-1]], axis=1)
        following = _before(visited, count)[..., None] == np.arange(len(goals))
        rewards = np.select(
            [(entered & following).any(axis=-1), entered.any(axis=-1), _inside(ee, obstacles)],
            [coefficients.goal, coefficients.wrong_order, coefficients.obstacle],
            0.0,
        )
        return rewards, (visited[:, -1], inside[:, -1])

    def continuous(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        ee = signals["ee"]
        distances = np.stack([_distance(ee, goal) for goal in goals], axis=-1)
        count = np.zeros(len(ee), dtype=np.int64) if memory is None else memory
        visited = goals_visited(distances <= goal_radius, count)
        following = _before(visited, count)[..., None] == np.arange(len(goals))
        weights = np.where(following, -coefficients.c1, coefficients.c2)
        rewards = np.sum(weights * distances, axis=-1) + coefficients.c3 * _distances(ee, obstacles)
        return rewards, visited[:, -1]

    return {"discrete": discrete, "continuous": continuous}


def goals_visited(inside: NDArray[np.bool_], before: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many goals were visited in the right order up to each sample.

    Args:
      inside: whether the end-effector is in each goal, goals in order, shape (N, T, goals).
      before: how many were visited before these samples, shape (N,).

    Returns:
      Shape (N, T).
    """
    count = np.zeros(inside.shape[:2], dtype=np.int64)
    visited = np.ones(inside.shape[:2], dtype=np.bool_)
    for goal in range(inside.shape[2]):
        already = (before > goal)[:, None]
        visited = already | np.logical_or.accumulate(inside[..., goal] & visited, axis=1)
        count += visited
    return count


def _before(count: NDArray[np.int64], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """The count (N, T) one sample earlier, `first` (N,) at the first."""
    return np.concatenate([first[:, None], count[:, :-1]], axis=1)


def _obstacles(constants: Mapping[str, Any]) -> list[tuple[Array, float]]:
    """Centre and radius of every obstacle."""
    centres, radii = required_constants(constants, obstacle=dict, obstacle_radius=dict)
    if centres.keys() != radii.keys():
        raise UserError(f"spec: obstacle has the members {list(centres)}, but obstacle_radius {list(radii)}")
    return [(np.array(centres[i]), radii[i]) for i in centres]


def _inside(points: Array, obstacles: list[tuple[Array, float]]) -> NDArray[np.bool_]:
    return np.any([_distance(points, centre) <= radius for centre, radius in obstacles], axis=0)


def _distances(points: Array, obstacles: list[tuple[Array, float]]) -> Array:
    return np.sum([_distance(points, centre) for centre, _ in obstacles], axis=0)


def _distance(points: Array, centre: Array) -> Array:
    """Euclidean distance, (..., 2) => (...)."""
    return np.asarray(np.sqrt(np.sum((points - centre) ** 2, axis=-1)))
