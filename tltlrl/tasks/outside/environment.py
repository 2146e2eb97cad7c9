"""A description of environments that step by themselves, common to Gymnasium and dm_control's suite."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.tasks.task import Stepping

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Described:
    """The description of an environment.

    Attributes:
      make: makes a new environment, with pictures or without.
      observations: name => how many numbers, in order.
      low, high: the least and the greatest value of each command, (d,).
      steps: samples of one episode; None if it has no end.
      timestep: time between two commands, s; None if the environment does not say it.
    """

    make: Callable[[bool], Stepping]
    observations: Mapping[str, int]
    low: Array
    high: Array
    steps: int | None
    timestep: float | None


def flat(observation: Any, names: Mapping[str, int]) -> Array:
    """Joins observations, by name or a single one, into one array (n,)."""
    parts = [observation[name] for name in names] if isinstance(observation, Mapping) else [observation]
    return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])


def checked_commands(low: Any, high: Any, what: str) -> tuple[Array, Array]:
    """Bounds of commands as arrays (d,).

    Raises:
      UserError: if a range is infinite or empty.
    """
    bounds = [np.asarray(bound, dtype=np.float64).ravel() for bound in (low, high)]
    if not np.isfinite(bounds).all() or not np.all(bounds[0] < bounds[1]):
        raise UserError(
            f"task.id: {what} has commands without finite bounds, so nobody knows what a full command is; take an "
            "environment with bounds"
        )
    return bounds[0], bounds[1]
