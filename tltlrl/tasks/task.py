"""The contract of a task, which describes what is simulated but does not step it.

Training steps the physics model in batches (`tltlrl.simulation.rollout`); `dm_env` users step it through
`tltlrl.tasks.environment`. Both only read this description.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from dm_control import mujoco
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.settings import setting

Array = NDArray[np.float64]
Signals = Mapping[str, Array]
Memory = Any  # what a reward remembers of the samples before; None at the start of an episode

KINDS = {float: "a number", tuple: "a vector", dict: "a family"}  # of a spec's constants
MOST_STEPS = 100_000


class StepReward(Protocol):
    """A hand-made reward: the same code serves batches of whole episodes and environments that go step by step."""

    def __call__(self, signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        """The rewards of a stretch of consecutive samples of N trajectories.

        Args:
          signals: signals of the stretch, name => (N, T) or (N, T, k).
          memory: the memory that the call for the stretch before returned; None at the start of the episodes.

        Returns:
          The rewards, shape (N, T), and the memory for the next stretch.
        """


@dataclass(frozen=True)
class Quantity:
    """A group of features or of commands.

    Attributes:
      name: name of the group, such as `velocities`.
      unit: unit of all its parts.
      parts: names of its parts, in order.
    """

    name: str
    unit: str
    parts: tuple[str, ...]


@dataclass(frozen=True)
class Joints:
    """The names of a task's groups about joints; each group has one part per joint, in the same order.

    Attributes:
      angles, velocities: groups of features, rad and rad/s.
      speeds: the group of commands that the velocities follow, rad/s.
    """

    angles: str = "angles"
    velocities: str = "velocities"
    speeds: str = "speeds"


class Stepping(Protocol):
    """One environment that steps by itself."""

    def reset(self, seed: int) -> Array:
        """The first observations, (n,)."""

    def step(self, command: Array) -> tuple[Array, float, bool]:
        """Makes one step: observations (n,), reward, and whether the episode is over.

        Raises:
          FloatingPointError: if it diverged.
        """

    def picture(self, height: int, width: int) -> NDArray[np.uint8]:
        """A picture of the present state, (height, width, 3).

        Raises:
          UserError: if no picture can be made on this machine.
        """


@dataclass(frozen=True)
class Outside:
    """The environment that makes a task's trajectories, in place of a model.

    Attributes:
      make: makes a new environment, with pictures or without.
      command_range: the least and the greatest value of each command, (d,) each.
      seed: seed of the start; None if each trajectory has its own start.
    """

    make: Callable[[bool], Stepping]
    command_range: tuple[Array, Array]
    seed: int | None


class Task(abc.ABC):
    """A robot, its start, its features s_t (`observation`), its commands u_t (`action`) and its signals.

    Attributes from `sensed` on are None or empty for a task without that capability.

    Attributes:
      name: the task's name in configs and CSV files.
      control_timestep: time between two samples, s; a multiple of the model's timestep.
      steps: samples T of one episode, s_0 .. s_{T-1}; T - 1 control steps lead from the first to the last.
      observation: the groups of features, in order.
      action: the groups of commands, in order.
      command_noise: standard deviation of the Gaussian noise on each command, in the command's unit, shape (d,). It
        is part of the simulation (an imperfect actuator), not of the policy.
      command_scale: the size of a full command, shape (d,); exploration is configured as a share of it.
      feedback: the gain matrix K of shape (d, n) for a feedback of 1; the configured feedback multiplies it.
      sensed: the values of the model's sensors (N, nsensordata) => the last features (N, m). `features` gives the
        features before them. There is no feedback on them: the rollout knows the sensors' values of a sample only after
        its command. Sensors of accelerations and forces have the values of the physics step before.
      start_spread: standard deviation of the start, shape (nv,), rad or m; drawn anew for each trajectory.
      units: signal => unit, for users.
      camera: name of the model's camera for films.
      skeleton: features (..., n) => points (..., P, 2), m: the robot as a polyline from its base to its end-effector,
        for pictures of the plane.
      joints: the groups about joints, for measures of motion and for calm motions.
      end_effector: the group of features with its position, m, for the length of its path.
      outside: an environment that steps by itself, in place of `make_physics` and `features`. The features are its
        observations and, last, the reward that came with them.
    """

    name: str
    control_timestep: float
    steps: int
    observation: tuple[Quantity, ...]
    action: tuple[Quantity, ...]
    command_noise: Array
    command_scale: Array
    feedback: Array
    sensed: Callable[[Array], Array] | None = None
    start_spread: Array | None = None
    units: Mapping[str, str] = MappingProxyType({})
    camera: str | None = None
    skeleton: Callable[[Array], Array] | None = None
    joints: Joints | None = None
    end_effector: str | None = None
    outside: Outside | None = None

    @cached_property
    def slices(self) -> Mapping[str, slice]:
        """Where each group of features lies: `features[..., task.slices["velocities"]]`."""
        return _spans(self.observation)

    @cached_property
    def command_slices(self) -> Mapping[str, slice]:
        """Where each group of commands lies."""
        return _spans(self.action)

    @property
    def joint_velocities(self) -> slice | NDArray[np.intp] | None:
        """Where the velocities of the joints that commands move lie among the features; None where unknown."""
        return None if self.joints is None else self.slices[self.joints.velocities]

    @property
    def joint_commands(self) -> slice:
        """Where the commands that move joints lie: all of them, unless the task names some."""
        return slice(None) if self.joints is None else self.command_slices[self.joints.speeds]

    @property
    def width(self) -> int:
        """The number n of features."""
        return sum(len(group.parts) for group in self.observation)

    @abc.abstractmethod
    def make_physics(self) -> mujoco.Physics:
        """Compiles the model into a new `Physics`."""

    @abc.abstractmethod
    def initial_state(self) -> tuple[Array, Array]:
        """Positions (nq,) and velocities (nv,) at s_0; every episode starts there."""

    @abc.abstractmethod
    def features(self, qpos: Array, qvel: Array) -> Array:
        """Features of a batch of states: (N, nq), (N, nv) => (N, n), or (N, n - m) where m are `sensed`."""

    @abc.abstractmethod
    def signals(self, features: Array, commands: Array) -> Signals:
        """The signals for specs, from features (N, T, n) and commands (N, T, d): name => (N, T) or (N, T, k)."""

    @abc.abstractmethod
    def reference(self) -> tuple[Array, Array]:
        """The motion that learning starts from: features (T, n) and commands (T, d).

        The first policy is u_t = u_ref_t + K (s_t - s_ref_t), so k_t = u_ref_t - K s_ref_t.
        """

    def terminated(self, features: Array) -> NDArray[np.bool_]:
        """Whether an episode ends at a sample: features (N, n) => (N,). Never, unless a task says otherwise."""
        return np.zeros(len(features), dtype=np.bool_)

    def outcomes(self, last_qpos: Array, last_qvel: Array) -> dict[str, NDArray[np.bool_]]:  # noqa: ARG002
        """What the task itself judges in trials, from their last states (N, nq) and (N, nv): name => (N,)."""
        return {}


def _spans(groups: Sequence[Quantity]) -> dict[str, slice]:
    ends = np.cumsum([len(group.parts) for group in groups])
    return {group.name: slice(int(end) - len(group.parts), int(end)) for group, end in zip(groups, ends, strict=True)}


def draw_command_noise(task: Task, shape: tuple[int, ...], rng: np.random.Generator | np.random.RandomState) -> Array:
    """Draws the actuators' noise on commands, shape (*shape, d), in the commands' unit. Nothing else adds noise."""
    return np.asarray(task.command_noise * rng.standard_normal((*shape, len(task.command_noise))))


def draw_starts(task: Task, count: int, rng: np.random.Generator | np.random.RandomState) -> Array | None:
    """Draws how far trajectories start from the task's start, (count, nv); without spread draws nothing, gives None."""
    if task.start_spread is None:
        return None
    return np.asarray(task.start_spread * rng.standard_normal((count, len(task.start_spread))))


@dataclass(frozen=True)
class NoReward:
    """The coefficients of a task that has no hand-made rewards."""

    step: dict[str, float] = setting("other values for step-based learners", {})


@dataclass(frozen=True)
class TaskEntry:
    """What a name in the registry of tasks stands for: how to build a task from configuration.

    Attributes:
      config: dataclass of the task's settings, each with a default; its field `name` is the task's name.
      make: an instance of `config` => the task.
      spec: file of the task's spec, if there is one.
      reward: dataclass of the coefficients of its hand-made rewards, each with a default. Its field `step` has other
        values for step-based learners, name => value.
      rewards: (coefficients, spec constants) => the hand-made rewards by name.
      hand_made: names of the hand-made rewards; `load_task` uses the first.
      evaluation: the config of training => the config of the scene for trials of learned policies.
      packages: installed packages whose versions decide its numbers, besides NumPy, SciPy, MuJoCo and dm_control.
    """

    config: type
    make: Callable[[Any], Task]
    spec: str | None = None
    reward: type = NoReward
    rewards: Callable[[Any, Mapping[str, Any]], dict[str, StepReward]] = lambda *_: {}
    hand_made: tuple[str, ...] = ()
    evaluation: Callable[[Any], Any] = lambda config: config
    packages: tuple[str, ...] = ()


def required_constants(constants: Mapping[str, Any], **kinds: type) -> list[Any]:
    """The values of the spec's constants that a hand-made reward needs, in the order of `kinds`.

    Args:
      constants: constants of the spec.
      kinds: name=float for a number, tuple for a vector, dict for a family.

    Raises:
      UserError: if the spec lacks some, or has them as another kind; it names them.
    """
    missing = [f"{name} ({KINDS[kind]})" for name, kind in kinds.items() if not isinstance(constants.get(name), kind)]
    if missing:
        raise UserError(
            f"spec: the hand-made rewards need its constants {', '.join(missing)}; it has "
            f"{', '.join(constants) or 'none'}. Define them, or train on the spec alone: cases=tltl_episodic"
        )
    return [constants[name] for name in kinds]
