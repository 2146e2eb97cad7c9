"""Environments of dm_control's suite."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from dm_control import suite
from dm_control.rl.control import PhysicsError
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest, printable
from tltlrl.tasks.outside.environment import Array, Described, checked_commands, flat


def described(identity: str) -> Described:
    """Describes the environment with a domain and task, such as ball_in_cup-catch.

    Raises:
      UserError: if there is no such environment.
    """
    names = ["-".join(names) for names in suite.ALL_TASKS]
    if identity not in names:
        near = nearest(identity, names) if identity else "; for instance task.id=ball_in_cup-catch"
        raise UserError(f"task.id: there is no environment {identity or 'without a name'}{near}")
    env = _made(identity)
    spec, period = env.action_spec(), float(env.control_timestep())
    low, high = checked_commands(spec.minimum, spec.maximum, identity)
    domain, _, task = identity.partition("-")
    limit = suite.load(domain, task)._step_limit
    sizes = {name: math.prod(part.shape) for name, part in env.observation_spec().items()}
    steps = round(limit) + 1 if math.isfinite(limit) else None
    return Described(lambda _: _Stepping(identity, list(sizes)), sizes, low, high, steps, period)


def _made(identity: str) -> Any:
    domain, _, task = identity.partition("-")
    return suite.load(domain, task, {"time_limit": math.inf, "random": 0})  # the task decides how long it runs


class _Stepping:
    def __init__(self, identity: str, names: list[str]) -> None:
        self._env, self._names = _made(identity), dict.fromkeys(names, 0)

    def reset(self, seed: int) -> Array:
        self._env.task.random.seed(seed)
        return flat(self._env.reset().observation, self._names)

    def step(self, command: Array) -> tuple[Array, float, bool]:
        try:
            timestep = self._env.step(command)
        except PhysicsError as error:
            raise FloatingPointError(str(error)) from None
        return flat(timestep.observation, self._names), float(timestep.reward or 0.0), bool(timestep.last())

    def picture(self, height: int, width: int) -> NDArray[np.uint8]:
        try:
            return np.array(self._env.physics.render(height, width, camera_id=0))
        except Exception as error:  # every backend has its own
            raise UserError(f"no picture can be rendered: {printable(error, 200)}") from None
