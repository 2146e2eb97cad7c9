"""Environments of Gymnasium; needs the extra `gym`."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from tltlrl.errors import UserError, nearest, printable
from tltlrl.tasks.outside.environment import Array, Described, checked_commands, flat


def described(identity: str) -> Described:
    """Describes the environment with an id.

    Raises:
      UserError: if Gymnasium is missing, there is no such environment, or it cannot be learned.
    """
    try:
        import gymnasium
        from gymnasium import spaces
    except ImportError as error:
        raise UserError(
            f'task: environments of Gymnasium need the extra gym ({error}); pip install "tltlrl[gym]"'
        ) from None
    if ":" in identity:
        raise UserError(
            f"task.id: {identity} names code to import, which no config may; install a package that registers its "
            "environments with Gymnasium, and give the id alone"
        )
    if identity not in gymnasium.registry:
        near = nearest(identity, gymnasium.registry) if identity else "; for instance task.id=Pendulum-v1"
        raise UserError(f"task.id: there is no environment {identity or 'without a name'}{near}")
    env = _made(identity)
    if not isinstance(env.action_space, spaces.Box):
        raise UserError(
            f"task.id: {identity} has commands of the kind {type(env.action_space).__name__}; expected continuous ones "
            "(Box); take another environment"
        )
    low, high = checked_commands(env.action_space.low, env.action_space.high, identity)
    sizes = _sizes(env.observation_space, identity)
    limit = gymnasium.spec(identity).max_episode_steps
    return Described(
        lambda pictured: _Stepping(identity, sizes, pictured),
        sizes,
        low,
        high,
        limit and limit + 1,
        _timestep(env.unwrapped),
    )


def _made(identity: str, **more: Any) -> Any:
    import gymnasium

    with _told(identity, "made"):
        return gymnasium.make(identity, max_episode_steps=-1, **more)  # the task decides how long it runs


@contextlib.contextmanager
def _told(identity: str, what: str) -> Iterator[None]:
    """Turns anything that the environment's code raises into a UserError."""
    try:
        yield
    except Exception as error:
        raise UserError(
            f"task.id: {identity} cannot be {what}: {type(error).__name__}: {printable(error, 200)}; mend it, or take "
            "another environment"
        ) from None


def _sizes(space: Any, identity: str) -> dict[str, int]:
    """Name => how many numbers, for every observation; a single one is called `observation`."""
    from gymnasium import spaces

    found = dict(space.spaces) if isinstance(space, spaces.Dict) else {"observation": space}
    for name, part in found.items():
        if not isinstance(part, spaces.Box | spaces.MultiBinary) or not part.shape:
            raise UserError(
                f"task.id: {identity} observes {name}, of the kind {type(part).__name__}; expected arrays of numbers "
                "(Box); take another environment"
            )
    return {name: math.prod(part.shape) for name, part in found.items()}


def _timestep(env: Any) -> float | None:
    for name in ("dt", "tau"):
        value = getattr(env, name, None)
        if isinstance(value, int | float) and value > 0:
            return float(value)
    frames = env.metadata.get("render_fps")
    return 1.0 / frames if frames else None


class _Stepping:
    def __init__(self, identity: str, sizes: Mapping[str, int], pictured: bool) -> None:
        self._identity, self._sizes = identity, sizes
        self._env = _made(identity, render_mode="rgb_array") if pictured else _made(identity)

    def reset(self, seed: int) -> Array:
        with _told(self._identity, "reset"):
            return flat(self._env.reset(seed=seed)[0], self._sizes)

    def step(self, command: Array) -> tuple[Array, float, bool]:
        space = self._env.action_space
        with _told(self._identity, "stepped"):
            observation, reward, over, cut, _ = self._env.step(command.reshape(space.shape).astype(space.dtype))
        return flat(observation, self._sizes), float(reward), bool(over or cut)

    def picture(self, height: int, width: int) -> NDArray[np.uint8]:
        try:
            frame = Image.fromarray(np.asarray(self._env.render(), dtype=np.uint8))
        except Exception as error:  # a renderer that is not installed
            raise UserError(f"no picture can be rendered: {printable(error, 200)}") from None
        return np.asarray(ImageOps.pad(frame, (width, height), color="white"))
