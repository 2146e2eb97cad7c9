"""Where a run stands, as its checkpoint holds it: a state as arrays, and back."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tltlrl.learning.policy import Policy
from tltlrl.store.files import write_bytes
from tltlrl.store.layout import CLAUSES, PROGRESS, TIMING
from tltlrl.store.run import DamagedError, drop_checkpoint, first_rows, read_checkpoint


@dataclass(frozen=True)
class Stand:
    """Where a run stands, as its checkpoint holds it.

    Attributes:
      state: the learner's state.
      best: the policy with the best mean motion simulated so far; the first policy before any was simulated.
      robustness: the robustness of that motion.
    """

    state: Any
    best: Policy
    robustness: float

    def seen(self, policy: Policy, robustness: float) -> Stand:
        """The stand after a policy's mean motion was simulated. If two are equally good, the newer is the best."""
        better = robustness >= self.robustness
        return Stand(self.state, policy if better else self.best, robustness if better else self.robustness)


def arrays_of(state: Any) -> dict[str, np.ndarray]:
    """The fields of a dataclass of arrays and numbers, by name; fields of a nested dataclass as `name.field`."""
    arrays: dict[str, np.ndarray] = {}
    for field in dataclasses.fields(state):
        value = getattr(state, field.name)
        if dataclasses.is_dataclass(value):
            arrays |= {f"{field.name}.{name}": array for name, array in arrays_of(value).items()}
        else:
            arrays[field.name] = np.asarray(value)
    return arrays


def from_arrays(like: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """A state with the fields of `like`, from the result of `arrays_of`; numbers become numbers again.

    Raises:
      DamagedError: if a field is missing, or there is an unknown one.
    """
    if set(arrays_of(like)) != set(arrays):
        raise DamagedError("the checkpoint is of another learner")
    values: dict[str, Any] = {}
    for field in dataclasses.fields(like):
        value, prefix = getattr(like, field.name), f"{field.name}."
        if dataclasses.is_dataclass(value):
            inner = {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
            values[field.name] = from_arrays(value, inner)
        else:
            saved = arrays[field.name]
            values[field.name] = saved if isinstance(value, np.ndarray) else saved.item()
    return type(like)(**values)


def resume(folder: Path, identity: str, like: Callable[[int], Any]) -> tuple[int, int, Any]:
    """Iterations done, their samples, and where a run stands; cuts the CSV files back to the checkpoint.

    Without a usable checkpoint the run starts again from its first state.

    Args:
      folder, identity: of the run.
      like: iterations done => a stand with the fields that the checkpoint should have; for 0, the first one.
    """
    try:
        saved = read_checkpoint(folder, identity)
        state = saved and from_arrays(like(saved.iteration), saved.state)
    except DamagedError:  # the command has said so; see tltlrl.experiments.results.survey
        saved = state = None
    if saved is None or state is None:
        drop_checkpoint(folder)
        for name in (PROGRESS, CLAUSES, TIMING):
            (folder / name).unlink(missing_ok=True)
        return 0, 0, like(0)
    for name in (PROGRESS, CLAUSES, TIMING):
        write_bytes(folder / name, first_rows(folder / name, saved.iteration))
    return saved.iteration, saved.env_steps, state
