"""A task as a `dm_env.Environment`, with any reward: hand-made, or a spec's robustness."""

from __future__ import annotations

import collections
from collections.abc import Mapping
from typing import Any

import numpy as np
from dm_control import mujoco
from dm_control.rl import control
from mujoco import mj_integratePos
from numpy.typing import NDArray

from tltlrl.logic import Spec
from tltlrl.tasks.fits import check_fits
from tltlrl.tasks.task import StepReward, Task, draw_command_noise, draw_starts

Array = NDArray[np.float64]


def environment(
    task: Task,
    reward: StepReward | Spec | None = None,
    random: np.random.RandomState | int | None = None,
    noise: bool = True,
) -> control.Environment:
    """Makes an environment of a task: `reset` gives s_0, the last of T - 1 steps gives s_{T-1}.

    A step returns the reward of the sample that it leads to. The command at that sample is not known yet. Where a
    reward or a spec needs it, the command that led there takes its place (0 at s_0).

    Args:
      task: what is simulated.
      reward: a hand-made reward, given at every step; or a spec, whose robustness is the reward of the last step
        (all others are 0); or None for 0 at every step.
      random: source or seed of the actuators' noise.
      noise: whether commands are noisy, and starts random where the task has a `start_spread`.

    Raises:
      UserError: if the spec does not fit the task: its signals, or a window that begins after the last sample.
    """
    if isinstance(reward, Spec):
        reward = reward.sampled(task.control_timestep)
        check_fits(reward, task)
    view = _View(task, reward, random, noise)
    # Half a step less than T - 1, so that rounding cannot add a step.
    time_limit = (task.steps - 1.5) * task.control_timestep
    return control.Environment(task.make_physics(), view, time_limit=time_limit, control_timestep=task.control_timestep)


class _View(control.Task):  # type: ignore[misc]  # dm_control has no types
    """A `Task` as dm_control wants it. The work per step does not grow with time."""

    def __init__(
        self, task: Task, reward: StepReward | Spec | None, random: np.random.RandomState | int | None, noise: bool
    ) -> None:
        self._task = task
        self._reward = reward
        self._noise = noise
        self._features = np.zeros((task.steps, task.width))
        self._commands = np.zeros((task.steps, len(task.command_scale)))
        self._sample = 0
        self._memory: Any = None
        self.random = random if isinstance(random, np.random.RandomState) else np.random.RandomState(random)

    def initialize_episode(self, physics: mujoco.Physics) -> None:
        """Puts the robot at its start."""
        physics.data.qpos[:], physics.data.qvel[:] = self._task.initial_state()
        if self._noise and (starts := draw_starts(self._task, 1, self.random)) is not None:
            mj_integratePos(physics.model.ptr, physics.data.qpos, starts[0], 1.0)
        physics.data.qacc_warmstart[:] = 0.0
        physics.forward()
        self._sample, self._memory = 0, None
        self._commands[0] = 0.0
        self._record(physics)
        if self._reward is not None and not isinstance(self._reward, Spec):
            _, self._memory = self._reward(self._signals(slice(0, 1)), None)

    def before_step(self, action: Array, physics: mujoco.Physics) -> None:
        """Sends the command, disturbed by the actuators' noise; MuJoCo clips it to the actuators' range."""
        self._commands[self._sample] = action
        disturbed = action + draw_command_noise(self._task, (), self.random) if self._noise else action
        physics.data.qacc_warmstart[:] = 0.0  # as in the batched rollout: contacts are solved alike
        physics.set_control(disturbed)

    def after_step(self, physics: mujoco.Physics) -> None:
        """Records the new sample, with the last command until its own is known."""
        self._sample += 1
        self._commands[self._sample] = self._commands[self._sample - 1]
        self._record(physics)

    def get_observation(self, physics: mujoco.Physics) -> collections.OrderedDict[str, Array]:  # noqa: ARG002
        """The latest features by group."""
        return collections.OrderedDict(
            (name, self._features[self._sample, where].copy()) for name, where in self._task.slices.items()
        )

    def get_reward(self, physics: mujoco.Physics) -> float:
        """The reward of the latest sample."""
        if self._reward is None:
            return 0.0
        if isinstance(self._reward, Spec):
            over = self._sample == self._task.steps - 1 or self.get_termination(physics) is not None
            return float(self._reward.robustness(self._signals(slice(0, self._sample + 1)))[0]) if over else 0.0
        rewards, self._memory = self._reward(self._signals(slice(self._sample, self._sample + 1)), self._memory)
        return float(rewards[0, 0])

    def action_spec(self, physics: mujoco.Physics) -> object:
        """Bounds of the commands, from the model."""
        return mujoco.action_spec(physics)

    def get_termination(self, physics: mujoco.Physics) -> float | None:  # noqa: ARG002
        """Discount 0 where the episode ends early."""
        return 0.0 if self._task.terminated(self._features[self._sample][None])[0] else None

    def _record(self, physics: mujoco.Physics) -> None:
        qpos, qvel = np.array(physics.data.qpos), np.array(physics.data.qvel)
        features = self._task.features(qpos[None], qvel[None])[0]
        self._features[self._sample, : len(features)] = features
        if self._task.sensed is not None:
            self._features[self._sample, len(features) :] = self._task.sensed(np.array(physics.data.sensordata)[None])[
                0
            ]

    def _signals(self, samples: slice) -> Mapping[str, Array]:
        return self._task.signals(self._features[None, samples], self._commands[None, samples])
