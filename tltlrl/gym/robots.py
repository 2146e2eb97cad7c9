"""Tasks as Gymnasium environments: one robot, or many whose physics and monitors are stepped in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from tltlrl.errors import UserError
from tltlrl.gym.judge import Array, Judge, Judgement, Mask, info_of
from tltlrl.logic import Spec, load_spec
from tltlrl.registry import TASKS
from tltlrl.resources import spec_path
from tltlrl.simulation.stepping import Stepper
from tltlrl.tasks.fits import check_fits
from tltlrl.tasks.task import Task, TaskEntry, draw_command_noise, draw_starts

LARGEST = 1e6  # observations are cut to this size
Generators = Sequence[np.random.Generator]


class _Robots:
    """N robots of a task and their judge; the single and the vector environment share it.

    Attributes:
      over: (N,), whether each robot's episode is over.
    """

    def __init__(
        self, task: str, spec: Spec | str | Path | None, constants: Any, reward: str, noise: bool, n: int
    ) -> None:
        entry: TaskEntry = TASKS.get(task)
        self.task: Task = entry.make(entry.config())
        if spec is None and entry.spec is None:
            raise UserError(f"spec: {task} has none of its own; expected one; pass spec=FILE")
        if not isinstance(spec, Spec):
            spec = load_spec(spec_path(str(spec or entry.spec)), constants)
        elif constants:
            raise UserError("constants: they go with the file of a spec; pass spec=FILE, or load the spec with them")
        spec = spec.sampled(self.task.control_timestep)
        check_fits(spec, self.task)
        self.judge, self.stepper, self.noise = Judge(spec, reward, n), Stepper(self.task, n), noise
        self.over, self._time = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=int)
        size = len(self.task.command_scale)
        first, _ = self._judged(np.zeros((n, size)), self.over)
        self.observation_space = spaces.Box(-LARGEST, LARGEST, first.shape[1:], np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (size,), np.float32)

    def begin(self, random: Generators) -> tuple[Any, Judgement]:
        """Begins new episodes: the first samples and their judgement."""
        n = len(self.over)
        return self._begun(np.zeros((n, *self.action_space.shape)), np.ones(n, dtype=np.bool_), random)

    def step(self, actions: Any, random: Generators) -> tuple[Any, Judgement]:
        """Makes one control step of each; where an episode was over, another begins, and the action is ignored.

        Raises:
          ValueError: if an action is NaN, for which MuJoCo would take 0.
          FloatingPointError: if a simulation diverged.
        """
        commands = np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0) * self.task.command_scale
        begins = self.over
        commands[begins] = 0.0  # before the first sample nothing is commanded
        if len(wrong := np.flatnonzero(np.isnan(commands).any(axis=1))):
            raise ValueError(f"the action for environment {wrong[0]} is NaN; look for what made it so in the policy")
        disturbed = commands.copy()
        if self.noise:
            for row in np.flatnonzero(~begins).tolist():
                disturbed[row] += draw_command_noise(self.task, (), random[row])
        self.stepper.step(disturbed)
        return self._begun(commands, begins, random)

    def _begun(self, commands: Array, begins: Mask, random: Generators) -> tuple[Any, Judgement]:
        for row in np.flatnonzero(begins).tolist():
            self.stepper.restart(row, draw_starts(self.task, 1, random[row]) if self.noise else None)
        return self._judged(commands, begins)

    def _judged(self, commands: Array, begins: Mask) -> tuple[Any, Judgement]:
        """The samples that `commands` led to, and their judgement."""
        features = self.stepper.features
        self._time = np.where(begins, 0, self._time + 1)
        self.over = ~begins & (self.task.terminated(features) | (self._time == self.task.steps - 1))
        signals = self.task.signals(features[:, None], commands[:, None])
        judged = self.judge.read({name: values[:, 0] for name, values in signals.items()}, begins, self.over)
        parts = [features, judged.state, self._time[:, None] / self.task.steps]
        return np.concatenate(parts, axis=1).clip(-LARGEST, LARGEST).astype(np.float32), judged


class SpecEnv(gymnasium.Env):  # type: ignore[misc]  # gymnasium may be missing
    """A task whose reward is a spec's robustness.

    Actions in [-1, 1] are shares of a full command. An observation holds the task's features, the monitor's state (cut
    where it is infinite) and t / T. An episode terminates at sample T - 1, where the robustness is final, or earlier
    if the task ends it. It is never truncated. `info` has robustness, lower and upper; at the end, is_success
    and decided_by.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # as gymnasium has it

    def __init__(
        self,
        task: str,
        spec: Spec | str | Path | None = None,
        constants: Mapping[str, object] | None = None,
        reward: str = "telescoped",
        noise: bool = True,
    ) -> None:
        self._robots = _Robots(task, spec, constants, reward, noise, 1)
        self.observation_space, self.action_space = self._robots.observation_space, self._robots.action_space

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """Begins an episode, with its first sample."""
        super().reset(seed=seed)
        del options
        (observation,), judged = self._robots.begin([self.np_random])
        return observation, info_of(judged)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Makes one control step."""
        (observation,), judged = self._robots.step(np.asarray(action)[None], [self.np_random])
        return observation, float(judged.rewards[0]), bool(self._robots.over[0]), False, info_of(judged)


class SpecVectorEnv(VectorEnv):  # type: ignore[misc]
    """`num_envs` environments of `SpecEnv`, stepped in one call. Each gives the same bits as it would alone."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        task: str,
        num_envs: int = 1,
        spec: Spec | str | Path | None = None,
        constants: Mapping[str, object] | None = None,
        reward: str = "telescoped",
        noise: bool = True,
    ) -> None:
        self.num_envs = num_envs
        self._robots = _Robots(task, spec, constants, reward, noise, num_envs)
        self.single_observation_space = self._robots.observation_space
        self.single_action_space = self._robots.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._random = [np.random.default_rng() for _ in range(num_envs)]

    def reset(self, *, seed: int | list[int | None] | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """The first samples; a seed counts up over the environments."""
        del options
        seeds = seed if isinstance(seed, list) else [None if seed is None else seed + i for i in range(self.num_envs)]
        for i, own in enumerate(seeds):
            if own is not None:
                self._random[i], _ = gymnasium.utils.seeding.np_random(own)
        observations, judged = self._robots.begin(self._random)
        return observations, self._infos(judged)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Makes one control step of each; one whose episode was over begins another instead, and ignores its action."""
        observations, judged = self._robots.step(actions, self._random)
        return (
            observations,
            judged.rewards,
            self._robots.over.copy(),
            np.zeros(self.num_envs, dtype=np.bool_),
            self._infos(judged),
        )

    def _infos(self, judged: Judgement) -> dict[str, Any]:
        """What is known, as Gymnasium puts the `info` of several environments together."""
        infos: dict[str, Any] = {}
        for name, values in judged.known.items():
            infos |= {name: values, f"_{name}": np.ones(self.num_envs, dtype=np.bool_)}
        for row, verdict in judged.verdicts.items():
            infos = self._add_info(infos, verdict, row)
        return infos
