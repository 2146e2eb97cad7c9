"""Whether a spec fits a task: it reads what the task offers, and the episodes are long enough for it."""

from __future__ import annotations

from tltlrl.errors import UserError, nearest
from tltlrl.logic import Spec
from tltlrl.tasks.task import Task


def check_fits(spec: Spec, task: Task) -> None:
    """Checks that a task has the signals that a spec reads, and that its episodes are long enough.

    Raises:
      UserError: if not; it says what there is.
    """
    features, commands = task.reference()
    signals = task.signals(features[None], commands[None])
    offered = {name: None if values.ndim == 2 else values.shape[2] for name, values in signals.items()}
    for name, dimension in spec.signals.items():
        if name not in offered:
            raise UserError(
                f"spec: it needs a signal {name}, which {task.name} has not{nearest(name, offered)}"
                f"{_named(name, dimension, task)}"
            )
        if dimension != offered[name]:
            raise UserError(
                f"spec: it reads {name} as {_kind(dimension)}, but in {task.name} it is {_kind(offered[name])}"
            )
    spec.check_length(signals)


def _named(name: str, dimension: int | None, task: Task) -> str:
    """How numbers of an observation get a name; of a robot, the page says it."""
    if task.outside is None:
        return ""
    part = f"[{0 if dimension is None else f'0:{dimension}'}]"
    return f"; name numbers of an observation by 'task.signals.{name}={task.observation[0].name}{part}'"


def _kind(dimension: int | None) -> str:
    return "a scalar" if dimension is None else f"a vector of {dimension}"
