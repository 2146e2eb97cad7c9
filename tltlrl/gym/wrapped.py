"""A spec around any Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from tltlrl.errors import UserError
from tltlrl.gym.judge import Array, Judge, info_of
from tltlrl.logic import Spec, load_spec


class _Wrapped(gymnasium.Wrapper):  # type: ignore[misc]
    """Another environment with a spec's robustness for its reward; see `wrap`."""

    def __init__(self, env: Any, spec: Spec, signals: Mapping[str, str], reward: str) -> None:
        super().__init__(env)
        self._judge, self._spec = Judge(spec, reward), spec
        self._sources = {name: _source(name, text) for name, text in signals.items()}
        for name in spec.signals:
            if name not in self._sources:
                raise UserError(f"signals: the spec needs {name}; expected its place; pass signals={{'{name}': ...}}")

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(seed=seed, options=options)
        idle = np.zeros_like(self.env.action_space.sample())
        judged = self._judge.read(self._signals(observation, info, idle), np.array([True]), np.array([False]))
        return observation, info | info_of(judged)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, _, terminated, truncated, info = self.env.step(action)
        over = np.array([bool(terminated or truncated)])
        judged = self._judge.read(self._signals(observation, info, action), np.array([False]), over)
        return observation, float(judged.rewards[0]), terminated, truncated, info | info_of(judged)

    def _signals(self, observation: Any, info: Any, action: Any) -> dict[str, Array]:
        places = {"observation": observation, "info": info, "action": action}
        return {name: _found(name, places, self._sources[name], d) for name, d in self._spec.signals.items()}


def wrap(env: Any, spec: Spec | str | Path, signals: Mapping[str, str], reward: str = "telescoped") -> Any:
    """Wraps an environment, so that its reward is a spec's robustness.

    Args:
      env: any Gymnasium environment.
      spec: the spec of the task.
      signals: name => where to find it: `observation`, `info` or `action`, then keys and slices in brackets, such as
        `observation[0:2]`, `observation[position][1]`, `info[distance]`. Before the first action, an action is 0.
      reward: `telescoped` or `final`.

    Raises:
      UserError: if a signal's place cannot be read, or one that the spec needs is missing.
    """
    return _Wrapped(env, spec if isinstance(spec, Spec) else load_spec(spec), signals, reward)


def _source(name: str, text: str) -> list[str | int | slice]:
    """`observation[a][0:2]` as ["observation", "a", slice(0, 2)]; nothing is evaluated."""
    root, *rest = text.replace("]", "").split("[")
    if root not in ("observation", "info", "action") or text.count("[") != text.count("]"):
        raise UserError(
            f"signals: {name} is at '{text}'; expected observation, info or action with keys or slices in "
            "brackets, such as observation[0:2]"
        )
    return [root, *(_step(part.strip()) for part in rest)]


def _step(part: str) -> str | int | slice:
    first, colon, last = part.partition(":")
    numbers = [bound for bound in (first, last) if bound]
    if not all(bound.lstrip("-").isdigit() for bound in numbers) or not (numbers or colon):
        return part.strip("'\"")
    return slice(int(first) if first else None, int(last) if last else None) if colon else int(first)


def _found(name: str, places: Mapping[str, Any], source: list[str | int | slice], dimension: int | None) -> Array:
    """The value at a place, (1,) for a scalar, else (1, d)."""
    value: Any = places
    for step in source:
        try:
            value = value[step]
        except (KeyError, IndexError, TypeError):
            raise UserError(f"signals: {name}: there is no {step!r} in {type(value).__name__} {value!r:.80}") from None
    array = np.asarray(value, dtype=np.float64)
    if array.size != (dimension or 1):
        raise UserError(f"signals: {name} has shape {array.shape} at its place; expected {dimension or 1} numbers")
    return array.reshape((1,) if dimension is None else (1, dimension))
