"""The contract between a task and the rest: one class, two ways in.

`dm_env` users step a task through `dm_control.rl.control.Environment`; training steps the same physics model in
batches (`tltlrl.simulation.rollout`). A task therefore states its features twice: from a live `Physics`, with its named
quantities, and from arrays of positions and velocities. A test holds the two against each other.
"""

from __future__ import annotations

import abc
import collections
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from dm_control import mujoco
from dm_control.rl import control
from numpy.typing import NDArray

from tltlrl.errors import UserError

Array = NDArray[np.float64]
Signals = dict[str, Array]
StepReward = Callable[[Mapping[str, Array]], Array]

KINDS = {float: "a number", tuple: "a vector", dict: "a family"}  # of a spec's constants
CONTROL_TIMESTEP = 0.05  # seconds: commands are sent at 20 Hz, as in the case study.


@dataclass(frozen=True)
class Quantity:
    """One column of the features or of the commands: its name and its unit."""

    name: str
    unit: str


class Task(control.Task, abc.ABC):  # type: ignore[misc]  # dm_control has no types
    """A robot, its start, its features s_t (`observation`), its commands u_t (`action`) and its signals.

    Attributes:
      name: the task's name in configs and CSV files.
      steps: samples T of one episode, s_0 .. s_{T-1}; T - 1 control steps lead from the first to the last.
      observation: one `Quantity` per feature, in order.
      action: one `Quantity` per command, in order.
      command_noise: standard deviation of the Gaussian noise on each command, in the command's unit. It is part
        of the simulation (an imperfect actuator), not of the policy.
      command_scale: the size of a full command, shape (d,); exploration is configured as a share of it.
      feedback: the gain matrix K of shape (d, n) for a feedback of 1; the configured feedback multiplies it.
      rewards: hand-made rewards per step by name; each maps signals of shape (N, T) or (N, T, d) to (N, T),
        where the value at t depends on the samples up to t.
      environment_reward: the one of `rewards` that `dm_env` users get.
      camera: of the model, for pictures.
    """

    name: str
    observation: tuple[Quantity, ...]
    action: tuple[Quantity, ...]
    environment_reward = "discrete"
    camera: str

    def __init__(
        self,
        steps: int,
        command_noise: Array,
        command_scale: Array,
        feedback: Array,
        rewards: Mapping[str, StepReward],
        random: np.random.RandomState | int | None = None,
    ) -> None:
        if steps < 2:
            raise UserError(f"task.steps: {steps} is too short for an episode; it must be at least 2")
        if np.any(command_noise < 0):
            raise UserError("task.command_noise: a standard deviation cannot be negative")
        self.steps = steps
        self.command_noise = command_noise
        self.command_scale = command_scale
        self.feedback = feedback
        self.rewards = dict(rewards)
        self._episode: list[Array] = []
        self.random = random if isinstance(random, np.random.RandomState) else np.random.RandomState(random)

    @abc.abstractmethod
    def make_physics(self) -> mujoco.Physics:
        """Compiles the model into a new `Physics`."""

    @abc.abstractmethod
    def initial_state(self) -> tuple[Array, Array]:
        """Positions (nq,) and velocities (nv,) at s_0; every episode starts there."""

    @abc.abstractmethod
    def features(self, qpos: Array, qvel: Array) -> Array:
        """Features of a batch of states: (N, nq), (N, nv) => (N, len(observation))."""

    @abc.abstractmethod
    def signals(self, features: Array, commands: Array) -> Signals:
        """What a spec can speak of: (N, T, n), (N, T, d) => name -> (N, T) or (N, T, k)."""

    @abc.abstractmethod
    def reference(self) -> tuple[Array, Array]:
        """The motion that learning starts from: features (T, n) and commands (T, d).

        The first policy is u_t = u_ref_t + K (s_t - s_ref_t), so k_t = u_ref_t - K s_ref_t.
        """

    def terminated(self, features: Array) -> NDArray[np.bool_]:
        """Whether an episode ends at a sample: features (N, n) => (N,). Never, unless a task says otherwise."""
        return np.zeros(len(features), dtype=np.bool_)

    def outcomes(self, last_qpos: Array, last_qvel: Array) -> dict[str, NDArray[np.bool_]]:  # noqa: ARG002
        """What can be judged of trials by other means than the spec, from their last states (N, nq) and (N, nv)."""
        return {}

    @abc.abstractmethod
    def observe(self, physics: mujoco.Physics) -> collections.OrderedDict[str, Array]:
        """The features of one live physics, in the order of `observation`."""

    # dm_control.rl.control.Task

    def initialize_episode(self, physics: mujoco.Physics) -> None:
        """Puts the robot at its start."""
        physics.data.qpos[:], physics.data.qvel[:] = self.initial_state()
        physics.forward()
        self._episode = [self._flat_features(physics)]

    def before_step(self, action: Array, physics: mujoco.Physics) -> None:
        """Sends the command, disturbed by the actuators' noise; MuJoCo clips it to the actuators' range."""
        physics.set_control(action + self.command_noise * self.random.standard_normal(len(self.action)))

    def after_step(self, physics: mujoco.Physics) -> None:
        """Remembers the episode: a reward may depend on what came before."""
        self._episode.append(self._flat_features(physics))

    def get_observation(self, physics: mujoco.Physics) -> collections.OrderedDict[str, Array]:
        """The features by group, as `dm_env` users expect them."""
        return self.observe(physics)

    def get_reward(self, physics: mujoco.Physics) -> float:  # noqa: ARG002
        """The hand-made reward of the latest sample; `physics` has nothing that the episode has not."""
        features = np.array(self._episode)[None]
        commands = np.zeros((1, features.shape[1], len(self.action)))  # no hand-made reward depends on them
        return float(self.rewards[self.environment_reward](self.signals(features, commands))[0, -1])

    def action_spec(self, physics: mujoco.Physics) -> object:
        """Bounds of the commands, from the model."""
        return mujoco.action_spec(physics)

    def get_termination(self, physics: mujoco.Physics) -> float | None:  # noqa: ARG002
        """Discount 0 where the episode ends early."""
        return 0.0 if self.terminated(self._episode[-1][None])[0] else None

    def _flat_features(self, physics: mujoco.Physics) -> Array:
        return np.concatenate([np.ravel(value) for value in self.observe(physics).values()])


def required_constants(constants: Mapping[str, Any], **kinds: type) -> list[Any]:
    """Constants of the spec by the names that the hand-made rewards rely on.

    Args:
      constants: of the spec.
      kinds: name=float for a number, tuple for a vector, dict for a family.

    Raises:
      UserError: naming those that the spec lacks, or has as something else.
    """
    missing = [f"{name} ({KINDS[kind]})" for name, kind in kinds.items() if not isinstance(constants.get(name), kind)]
    if missing:
        raise UserError(
            f"spec: the hand-made rewards need its constants {', '.join(missing)}; it has "
            f"{', '.join(constants) or 'none'}. Define them, or train on the spec alone: cases=[tltl_episodic]"
        )
    return [constants[name] for name in kinds]


def environment(task: Task) -> control.Environment:
    """The task as a `dm_env.Environment`: `reset` gives s_0, the last of T - 1 steps gives s_{T-1}."""
    physics = task.make_physics()
    # Half a step less than T - 1, so that rounding cannot add a step.
    time_limit = (task.steps - 1.5) * CONTROL_TIMESTEP
    return control.Environment(physics, task, time_limit=time_limit, control_timestep=CONTROL_TIMESTEP)
