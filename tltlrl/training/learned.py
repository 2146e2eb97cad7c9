"""Reads the policy of a finished run, and checks it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.store.layout import POLICY
from tltlrl.store.run import DamagedError, read_policy
from tltlrl.tasks.task import Task


def learned_policy(folder: Path, name: str = POLICY) -> Policy:
    """A policy of a finished run, read from its file.

    Args:
      folder: of the run.
      name: of the file: policy.npz, or calm.npz beside it.

    Raises:
      DamagedError: if the file cannot be read, or holds no policy.
    """
    try:
        return policy_of(read_policy(folder, name))
    except (KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} cannot be read ({error})") from error


def check_policy(task: Task, policy: Policy) -> None:
    """Checks that a policy has the shapes of the task, which its digest does not show.

    Raises:
      DamagedError: if it does not.
    """
    expected = (len(task.command_scale), task.width), (task.steps, len(task.command_scale))
    if (policy.gain.shape, policy.mean.shape) != expected:
        raise DamagedError(
            f"its policy has arrays of the shapes {policy.gain.shape} and {policy.mean.shape}, and {task.name} needs "
            f"{expected[0]} and {expected[1]}"
        )
    if not all(np.isfinite(array).all() for array in (policy.gain, policy.mean, policy.covariance)):
        raise DamagedError("its policy holds values that are not finite")


def policy_of(saved: Mapping[str, NDArray[np.generic]]) -> Policy:
    """The policy made of its saved arrays, name => array.

    Raises:
      KeyError, ValueError, TypeError: if the arrays make no policy.
    """
    gain, mean, covariance = (saved[name].astype(np.float64) for name in ("gain", "mean", "covariance"))
    (steps, d) = mean.shape
    if gain.shape[0] != d or gain.ndim != 2 or covariance.shape != (steps, d, d):
        raise ValueError(f"arrays of the shapes {gain.shape}, {mean.shape} and {covariance.shape} are no policy")
    return Policy(gain, mean, covariance, float(saved["correlation"]))
