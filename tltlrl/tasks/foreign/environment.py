"""What an environment that steps is asked for, whoever made it: the same for Gymnasium and for dm_control's suite."""

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
    """What an environment says of itself.

    Attributes:
      make: a new one, with pictures or without.
      observations: name => how many numbers it is, in order.
      low, high: the least and the most of each command, (d,).
      steps: samples of one episode; None if it has no end.
      timestep: between two commands, s; None if it says none.
    """

    make: Callable[[bool], Stepping]
    observations: Mapping[str, int]
    low: Array
    high: Array
    steps: int | None
    timestep: float | None


def flat(observation: Any, names: Mapping[str, int]) -> Array:
    """Observations by name, or one alone, as one array (n,)."""
    parts = [observation[name] for name in names] if isinstance(observation, Mapping) else [observation]
    return np.concatenate([np.asarray(part, dtype=np.float64).ravel() for part in parts])


def checked_commands(low: Any, high: Any, what: str) -> tuple[Array, Array]:
    """Bounds of commands as arrays (d,).

    Raises:
      UserError: if one is infinite or empty.
    """
    bounds = [np.asarray(bound, dtype=np.float64).ravel() for bound in (low, high)]
    if not np.isfinite(bounds).all() or not np.all(bounds[0] < bounds[1]):
        raise UserError(
            f"task.id: {what} has commands without finite bounds, so nobody knows what a full command is; take an "
            "environment with bounds"
        )
    return bounds[0], bounds[1]
