"""An environment of others as a task: its observations and its reward are features and signals."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from dm_control import mujoco

from tltlrl.errors import UserError, nearest
from tltlrl.logic import is_signal_name
from tltlrl.tasks.outside.environment import Described
from tltlrl.tasks.outside.keys import OutsideConfig
from tltlrl.tasks.task import Array, Memory, Outside, Quantity, Signals, StepReward, Task

COMMAND, REWARD = "command", "reward"
SLICE = re.compile(r"([^\[\]]+)(?:\[(-?\d+)?(:)?(-?\d+)?\])?")


def own_rewards(coefficients: object, constants: Mapping[str, Any]) -> dict[str, StepReward]:  # noqa: ARG001
    """The environment's own reward, name => reward."""
    return {"environment": _as_paid}


def _as_paid(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
    return signals[REWARD], memory


class OutsideTask(Task):
    """An environment: its features are its observations and, last, the reward that led to them."""

    def __init__(self, config: OutsideConfig) -> None:
        """Makes the environment once, to find its observations and commands.

        Raises:
          UserError: if there is no environment with that id, or it cannot be learned.
        """
        self.config = config
        said = _described(config)
        self.name = "".join(c if c.isalnum() else "_" for c in config.id)
        self.steps = _given(config.steps, said.steps, "steps", "how many samples an episode has, as task.steps=200")
        self.control_timestep = _given(
            config.control_timestep, said.timestep, "control_timestep", "it, as task.control_timestep=0.05"
        )
        names = [*said.observations, REWARD]
        if len(set(names)) < len(names) or COMMAND in names:
            raise UserError(
                f"task.id: {config.id} has an observation named {REWARD} or {COMMAND}, which mean something"
            )
        self.observation = tuple(
            Quantity(name, "", _parts(name, size)) for name, size in {**said.observations, REWARD: 1}.items()
        )
        size = len(said.low)
        self.action = (Quantity("commands", "", tuple(f"{COMMAND}_{i}" for i in range(size))),)
        self.command_scale = (said.high - said.low) / 2
        self.command_noise = config.command_noise * self.command_scale
        self.outside: Outside = Outside(said.make, (said.low, said.high), config.start)
        self._columns = self._signals_named(config.signals)
        self.feedback = self._gains(config.feedback)

    def make_physics(self) -> mujoco.Physics:
        """Not available: the environment steps its own physics.

        Raises:
          UserError: always.
        """
        raise UserError(f"task: {self.config.id} is an environment that steps by itself, without a model of ours")

    def initial_state(self) -> tuple[Array, Array]:
        """Not available; see `make_physics`."""
        return np.zeros(0), np.zeros(0)

    def features(self, qpos: Array, qvel: Array) -> Array:
        """Not available; see `make_physics`."""
        return np.zeros((len(qpos), 0 * len(qvel)))

    def signals(self, features: Array, commands: Array) -> Signals:
        """Every observation, the reward, slices by the user's names, and `command`."""
        found = {name: features[..., columns] for name, columns in self._columns.items()}
        found[COMMAND] = commands
        return {name: values[..., 0] if values.shape[-1] == 1 else values for name, values in found.items()}

    def reference(self) -> tuple[Array, Array]:
        """The features at the start, and the middle of every command's range, at all steps."""
        low, high = self.outside.command_range
        first = np.append(self.outside.make(False).reset(self.outside.seed or 0), 0.0)
        return np.tile(first, (self.steps, 1)), np.tile((low + high) / 2, (self.steps, 1))

    def _signals_named(self, given: Mapping[str, Any]) -> dict[str, list[int]]:
        """Signal => where its values lie among the features."""
        whole = {name: list(range(where.start, where.stop)) for name, where in self.slices.items()}
        found = {name: columns for name, columns in whole.items() if is_signal_name(name)}
        for name, slices in given.items():
            if not is_signal_name(name) or name in (*whole, COMMAND):
                raise UserError(f"task.signals.{name}: it cannot be a name of a signal here; choose another name")
            parts = slices if isinstance(slices, list) else [slices]
            found[name] = [column for part in parts for column in _cut(str(part), whole, f"task.signals.{name}")]
        return found

    def _gains(self, given: Mapping[str, Any]) -> Array:
        """K for algorithm.feedback=-1, its default, is what the settings say."""
        features = [part for group in self.observation[:-1] for part in group.parts]
        commands = self.action[0].parts
        gain = np.zeros((len(commands), self.width))
        for command, gains in given.items():
            if command not in commands:
                raise UserError(f"task.feedback.{command}: there is no such command{nearest(command, commands)}")
            if not isinstance(gains, Mapping):
                raise UserError(f"task.feedback.{command}: expected {{FEATURE: gain}}, not {gains!r}")
            for feature, number in gains.items():
                where = f"task.feedback.{command}.{feature}"
                if feature not in features:
                    raise UserError(f"{where}: there is no such feature{nearest(feature, features)}")
                if isinstance(number, bool) or not isinstance(number, int | float):
                    raise UserError(f"{where}: expected a number, not {number!r}")
                gain[commands.index(command), features.index(feature)] = -float(number)
        return gain


def _described(config: OutsideConfig) -> Described:
    if config.name == "suite":
        from tltlrl.tasks.outside.of_suite import described  # takes a second to import
    else:
        from tltlrl.tasks.outside.of_gymnasium import described

    return described(config.id)


def _given(own: Any, said: Any, key: str, what: str) -> Any:
    value = own if own is not None else said
    if value is None:
        raise UserError(f"task.{key}: the environment says none; say {what}")
    return value


def _parts(name: str, size: int) -> tuple[str, ...]:
    return (name,) if size == 1 else tuple(f"{name}_{i}" for i in range(size))


def _cut(text: str, whole: Mapping[str, Sequence[int]], key: str) -> Sequence[int]:
    """`position[0:2]` as its columns."""
    match = SLICE.fullmatch(text)
    if match is None:
        raise UserError(f"{key}: {text} is no slice of an observation; write NAME, NAME[0] or NAME[0:2]")
    name, first, colon, last = match.groups()
    if name not in whole:
        raise UserError(f"{key}: there is no observation {name}{nearest(name, whole)}")
    columns = whole[name]
    if "[" not in text:
        return columns
    if colon:
        cut = columns[int(first) if first else None : int(last) if last else None]
    else:
        place = int(first) if first else len(columns)
        cut = columns[place : place + 1 or None] if -len(columns) <= place < len(columns) else []
    if not cut:
        raise UserError(f"{key}: {text} is empty: {name} has {len(columns)} numbers, 0 to {len(columns) - 1}")
    return cut
