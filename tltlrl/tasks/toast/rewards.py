"""The hand-made reward of the toast task, eq. 3.9 of the case study."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tltlrl.settings import check, setting
from tltlrl.tasks.task import Array, Memory, Signals, StepReward, required_constants
from tltlrl.tasks.toast.scene import GRIPPER_RANGE


@dataclass(frozen=True)
class ToastReward:
    """Coefficients of eq. 3.9; c1, c2 and c3 from docs/grid_search.md."""

    c1: float = setting("price of a metre from the centre of the slot", 1.0)
    c2: float = setting("gain of a metre from the centre of the toaster", 1.2)
    c3: float = setting(
        "price of one per cent of gripper position away from closed (before the slot) or open (after)", 0.1
    )
    reached: float = setting("distance from the centre of the slot that counts as reached, m", 0.03, least=0)
    step: dict[str, float] = setting("other values for step-based learners", {})

    def __post_init__(self) -> None:
        check(self, "reward")


def toast_rewards(coefficients: ToastReward, constants: Mapping[str, Any]) -> dict[str, StepReward]:
    """The reward `continuous`, eq. 3.9, with which the case study compares TLTL.

    It rewards being near the slot, being far from the toaster, and a gripper that is closed until the slot was reached
    and open from then on. It maps the signals `ee` (..., T, 3) and `gripper` (..., T) to (..., T). Where the equation
    says "the toaster regions", the distance is from the centre of the toaster.

    Args:
      coefficients: the coefficients of eq. 3.9.
      constants: the spec's: slot_centre and toaster_centre, (x, y, z) in m.

    Raises:
      UserError: if the spec has no such constants.
    """
    slot, toaster = (np.array(c) for c in required_constants(constants, slot_centre=tuple, toaster_centre=tuple))

    def continuous(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        to_slot = np.linalg.norm(signals["ee"] - slot, axis=-1)
        to_toaster = np.linalg.norm(signals["ee"] - toaster, axis=-1)
        closest = closest_before(to_slot, memory)
        wanted = np.where(closest[..., :-1] < coefficients.reached, GRIPPER_RANGE, 0.0)
        gripper_error = np.abs(wanted - signals["gripper"])
        rewards = -coefficients.c1 * to_slot + coefficients.c2 * to_toaster - coefficients.c3 * gripper_error
        return np.asarray(rewards), closest[..., -1]

    return {"continuous": continuous}


def closest_before(distance: Array, memory: Array | None) -> Array:
    """The smallest distance at the samples before t, for t = 0 .. T: (N, T) => (N, T + 1).

    Args:
      distance: at each sample.
      memory: the smallest of earlier samples, shape (N,); None if there were none.
    """
    earlier = np.full(len(distance), np.inf) if memory is None else memory
    return np.minimum.accumulate(np.concatenate([earlier[:, None], distance], axis=1), axis=1)
