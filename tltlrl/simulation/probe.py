"""Moves a robot by random commands, to see the ranges of its signals and whether its simulation diverges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.simulation.rollout import DivergedError
from tltlrl.simulation.simulator import simulator_of
from tltlrl.tasks.task import Signals, Task

Array = NDArray[np.float64]
COUNT = 8  # trajectories
FEW = 200  # samples of each trajectory of an environment, which cannot step them together


def ranges_seen(task: Task, rng: np.random.Generator) -> dict[str, tuple[Array, Array]]:
    """Signal => least and greatest value of each component, (k,) each, under random commands of full size.

    Half of the trajectories get a new command at every step; each of the others keeps one command.

    Raises:
      UserError: if the simulation diverges; it says when.
    """
    signals = _signals_seen(task, rng, np.zeros_like(task.feedback))
    wide = {name: values.reshape(-1, 1 if values.ndim == 2 else values.shape[2]) for name, values in signals.items()}
    return {name: (values.min(axis=0), values.max(axis=0)) for name, values in wide.items()}


def reached(task: Task, signal: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """A signal at the start, (k,), and at the end of the random trajectory that takes it farthest, (k,).

    The task's feedback holds against the commands, as it does when learning begins.

    Raises:
      UserError: if the simulation diverges; it says when.
    """
    values = _signals_seen(task, rng, -task.feedback)[signal]
    farthest = np.linalg.norm(values[:, -1] - values[:, 0], axis=-1).argmax()
    return values[farthest, 0], values[farthest, -1]


def _signals_seen(task: Task, rng: np.random.Generator, gain: Array) -> Signals:
    features, commands = task.reference() if task.outside is None else (each[:FEW] for each in task.reference())
    push = task.command_scale * rng.uniform(-1, 1, (COUNT, *commands.shape))
    push[COUNT // 2 :] = push[COUNT // 2 :, :1]
    try:
        motion = simulator_of(task).rollout(gain, commands - features @ gain.T + push, np.zeros_like(push))
    except DivergedError as error:  # a task is not taken before it bears full commands, so exploring less is no help
        helps = f"; {error.advice}, or a smaller ctrlrange of its actuators usually helps" if error.advice else ""
        raise UserError(f"task: under random commands of full size {error.where}{helps}") from None
    return task.signals(motion.features, motion.commands)
