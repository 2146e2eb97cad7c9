"""Gymnasium environments: `import tltlrl.gym` registers one per task, and `wrap` puts a spec around any other.

    env = gymnasium.make("tltlrl/VisitInOrder-v0", spec="my_task.tltl", constants={"goal_radius": 0.3})

Needs the extra `gym` (pip install "tltlrl[gym]"). The reward is the spec's robustness: `telescoped` over the steps, by
the potential `stages` (see docs/online.md), or `final`, all at the end. Without discount, `final` sums to the
robustness and `telescoped` to the robustness less the potential of the first sample, which no policy changes. An
infinite robustness counts as -10 or 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

try:
    import gymnasium
except ModuleNotFoundError:
    raise ImportError("tltlrl.gym needs Gymnasium; install it with: pip install 'tltlrl[gym]'") from None
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.logic import Spec, load_spec
from tltlrl.logic.online.potential import FLOOR, finite, stages
from tltlrl.registry import TASKS
from tltlrl.resources import spec_path
from tltlrl.simulation.stepping import Stepper
from tltlrl.tasks.task import Task, TaskEntry, draw_command_noise, draw_starts

Array = NDArray[np.float64]
REWARDS = ("telescoped", "final")
LARGEST = 1e6  # of an observation, beyond which it is cut


class Judge:
    """The spec's part in one environment: rewards, what is known, and the monitor's state for the observation."""

    def __init__(self, spec: Spec, reward: str) -> None:
        if reward not in REWARDS:
            raise UserError(f"reward: no such reward {reward}{nearest(reward, REWARDS)}")
        self._spec, self._telescoped = spec, reward == "telescoped"
        if spec.monitor().keeps_past:
            raise UserError(
                f"spec: '{spec.formula}' needs the whole past, which no observation holds; expected a formula "
                "with shorter windows inside unbounded operators; see docs/online.md"
            )

    def begin(self, signals: Mapping[str, Array]) -> tuple[Array, dict[str, Any]]:
        """The first sample: the monitor's state and what is known."""
        self._witness = self._spec.watch()
        self._reading = self._witness.update(signals)
        self._phi = float(stages(self._witness.monitor, self._reading)[0]) if self._telescoped else 0.0
        return self._state(), self._known()

    def go_on(self, signals: Mapping[str, Array], over: bool) -> tuple[float, Array, dict[str, Any]]:
        """One more sample: the reward, the monitor's state, and what is known."""
        self._reading = self._witness.update(signals)
        before, info = self._phi, self._known()
        if over:
            self._phi = float(finite(self._reading.robustness)[0])
            why = self._witness.explanation()
            info |= {"is_success": bool(why.satisfied), "decided_by": why.decided_by}
        elif self._telescoped:
            self._phi = float(stages(self._witness.monitor, self._reading)[0])
        return self._phi - before, self._state(), info

    def _known(self) -> dict[str, Any]:
        reading = self._reading
        return {name: float(getattr(reading, name)[0]) for name in ("robustness", "lower", "upper")}

    def _state(self) -> Array:
        assert self._reading.state is not None
        return np.nan_to_num(self._reading.state[0], nan=0.0, posinf=FLOOR, neginf=-FLOOR)


class _Arms:
    """N robots of a task with their judges: what the single and the vector environment share."""

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
        self.judges = [Judge(spec, reward) for _ in range(n)]
        self.stepper, self.noise = Stepper(self.task, n), noise
        self.time = np.zeros(n, dtype=int)
        self.width = self.task.width + len(self.judges[0].begin(self._signals(0, np.zeros(self.size)))[0]) + 1
        self.observation_space = spaces.Box(-LARGEST, LARGEST, (self.width,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (self.size,), np.float32)

    @property
    def size(self) -> int:
        return len(self.task.command_scale)

    def begin(self, row: int, rng: np.random.Generator) -> tuple[Any, dict[str, Any]]:
        self.stepper.restart(row, draw_starts(self.task, 1, rng) if self.noise else None)
        self.time[row] = 0
        state, info = self.judges[row].begin(self._signals(row, np.zeros(self.size)))
        return self._observation(row, state), info

    def commands(self, actions: Any) -> Array:
        return np.clip(np.asarray(actions, dtype=np.float64), -1.0, 1.0) * self.task.command_scale

    def disturbed(self, commands: Array, rng: np.random.Generator) -> Array:
        return commands + draw_command_noise(self.task, (), rng) if self.noise else commands

    def judged(self, row: int, command: Array) -> tuple[Any, float, bool, dict[str, Any]]:
        """After a step: observation, reward, whether it is over, info. `command` led to the sample."""
        self.time[row] += 1
        ended = bool(self.task.terminated(self.stepper.features[row : row + 1])[0])
        over = ended or bool(self.time[row] == self.task.steps - 1)
        reward, state, info = self.judges[row].go_on(self._signals(row, command), over)
        return self._observation(row, state), reward, over, info

    def _signals(self, row: int, command: Array) -> Mapping[str, Array]:
        signals = self.task.signals(self.stepper.features[None, row : row + 1], command[None, None])
        return {name: values[0] for name, values in signals.items()}

    def _observation(self, row: int, state: Array) -> Any:
        parts = [self.stepper.features[row], state, [self.time[row] / self.task.steps]]
        return np.concatenate(parts).clip(-LARGEST, LARGEST).astype(np.float32)


class SpecEnv(gymnasium.Env):  # type: ignore[misc]  # gymnasium may be missing
    """A task whose reward is a spec's robustness.

    Actions in [-1, 1] are shares of a full command. An observation holds the task's features, the monitor's state (cut
    where it is infinite) and t / T. An episode terminates at sample T - 1, where the value is decided, and where the
    task ends it; it is never truncated. `info` has robustness, lower and upper, at the end is_success and decided_by.
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
        self._arms = _Arms(task, spec, constants, reward, noise, 1)
        self.observation_space, self.action_space = self._arms.observation_space, self._arms.action_space

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """The first sample."""
        super().reset(seed=seed)
        del options
        return self._arms.begin(0, self.np_random)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One control step."""
        (command,) = self._arms.commands(np.asarray(action)[None])
        self._arms.stepper.step(self._arms.disturbed(command, self.np_random)[None])
        observation, reward, over, info = self._arms.judged(0, command)
        return observation, reward, over, False, info


class SpecVectorEnv(VectorEnv):  # type: ignore[misc]
    """`count` environments of `SpecEnv` whose physics is stepped in one call; each is as it would be alone."""

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
        self._arms = _Arms(task, spec, constants, reward, noise, num_envs)
        self.single_observation_space = self._arms.observation_space
        self.single_action_space = self._arms.action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._random = [np.random.default_rng() for _ in range(num_envs)]
        self._over = np.zeros(num_envs, dtype=np.bool_)

    def reset(self, *, seed: int | list[int | None] | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        """The first samples; a seed counts up over the environments."""
        del options
        seeds = seed if isinstance(seed, list) else [None if seed is None else seed + i for i in range(self.num_envs)]
        for i, own in enumerate(seeds):
            if own is not None:
                self._random[i], _ = gymnasium.utils.seeding.np_random(own)
        self._over[:] = False
        observations, infos = [], dict[str, Any]()
        for i in range(self.num_envs):
            observation, info = self._arms.begin(i, self._random[i])
            observations.append(observation)
            infos = self._add_info(infos, info, i)
        return np.stack(observations), infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """One control step of each; one that was over begins anew instead, and its action is not looked at."""
        arms = self._arms
        commands = arms.commands(actions)
        again = self._over.copy()
        disturbed = commands.copy()
        for i in np.flatnonzero(~again).tolist():
            disturbed[i] = arms.disturbed(commands[i], self._random[i])
        arms.stepper.step(disturbed)
        observations, rewards, infos = [], np.zeros(self.num_envs), dict[str, Any]()
        for i in range(self.num_envs):
            if again[i]:
                observation, info = arms.begin(i, self._random[i])
                self._over[i] = False
            else:
                observation, rewards[i], self._over[i], info = arms.judged(i, commands[i])
            observations.append(observation)
            infos = self._add_info(infos, info, i)
        return np.stack(observations), rewards, self._over.copy(), np.zeros(self.num_envs, dtype=np.bool_), infos


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
        _, known = self._judge.begin(self._signals(observation, info, idle))
        return observation, info | known

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, _, terminated, truncated, info = self.env.step(action)
        over = bool(terminated or truncated)
        reward, _, known = self._judge.go_on(self._signals(observation, info, action), over)
        return observation, reward, terminated, truncated, info | known

    def _signals(self, observation: Any, info: Any, action: Any) -> dict[str, Array]:
        places = {"observation": observation, "info": info, "action": action}
        return {name: _found(name, places, self._sources[name], d) for name, d in self._spec.signals.items()}


def wrap(env: Any, spec: Spec | str | Path, signals: Mapping[str, str], reward: str = "telescoped") -> Any:
    """An environment whose reward is a spec's robustness.

    Args:
      env: any Gymnasium environment.
      spec: of the task.
      signals: name => where it is found: `observation`, `info` or `action`, then keys and slices in brackets, such as
        `observation[0:2]`, `observation[position][1]`, `info[distance]`. Before the first action it is 0.
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


for _name in TASKS.names():
    gymnasium.register(
        f"tltlrl/{''.join(part.capitalize() for part in _name.split('_'))}-v0",
        entry_point="tltlrl.gym:SpecEnv",
        vector_entry_point="tltlrl.gym:SpecVectorEnv",
        kwargs={"task": _name},
    )
