"""Closed-loop simulation of N trajectories at once.

One control step of the batch is one call into C (`mujoco.rollout`) that steps all trajectories. Whole runs are what is
parallel.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from tltlrl.simulation.scene import HELPS, HUGE, ROUNDING, scene_of
from tltlrl.tasks.task import Task, draw_command_noise, draw_starts

Array = NDArray[np.float64]
ROWS = 10_000  # samples whose features are computed at once: more are no faster, and take more memory


class DivergedError(FloatingPointError):
    """A simulation that diverged.

    Attributes:
      where: what diverged and when.
      advice: what usually helps, besides less exploration; may be empty.
    """

    def __init__(self, where: str, advice: str = "") -> None:
        super().__init__(where, advice)
        self.where, self.advice = where, advice

    def __str__(self) -> str:
        also = f"{self.advice}, or " if self.advice else ""
        return f"{self.where}; {also}less exploration (algorithm.initial_std) usually helps"


def entries(task: Task, qpos: Array, qvel: Array) -> NDArray[np.int64]:
    """For each feature that is a single position or velocity its index in (q, v); for any other one -1.

    Found by asking for the features of two states near the given one, whose entries all differ.

    Args:
      task: whose features.
      qpos, qvel: a state, shapes (nq,) and (nv,).
    """
    states = np.concatenate([qpos, qvel]) + 0.01 * np.random.default_rng(0).standard_normal((2, len(qpos) + len(qvel)))
    features = task.features(states[:, : len(qpos)], states[:, len(qpos) :])
    same = (features[:, :, None] == states[:, None]).all(axis=0)
    return np.where(same.any(axis=1), same.argmax(axis=1), -1)


def _blocks(steps: int, count: int) -> list[slice]:
    """The steps in blocks of at most ROWS samples of all `count` trajectories, at least a step each."""
    size = max(1, ROWS // count)
    return [slice(first, first + size) for first in range(0, steps, size)]


def _diverged(
    path: Array, times: Array, features: Array, commands: Array, sent: Array, lengths: NDArray[np.int64]
) -> tuple[int, int] | None:
    """The first step and, at that step, the first trajectory that diverged; None if none did.

    MuJoCo skips the rest of a control step in which something went wrong, and ignores a huge control.
    """
    late = np.abs(path[..., 0] - times[:, None]) > ROUNDING * np.maximum(np.arange(len(path)), 1)[:, None]
    small = all(np.abs(numbers).max() < HUGE for numbers in (path, commands, sent, features))  # a NaN is not
    if small and not late.any():  # nearly always
        return None
    sound = ~late & (np.abs(path) < HUGE).all(axis=2)
    sound[1:] &= (np.abs(sent) < HUGE).all(axis=2)[:-1]
    sound &= np.isfinite(features).all(axis=2) & np.isfinite(commands).all(axis=2)
    wrong = np.argwhere(~sound & (np.arange(len(path))[:, None] < lengths))
    return (int(wrong[0, 0]), int(wrong[0, 1])) if len(wrong) else None


@dataclass(frozen=True)
class Trajectories:
    """N trajectories of at most T samples.

    Attributes:
      features: s_t, shape (N, T, n); after a trajectory's end its last sample repeats.
      commands: u_t = K s_t + offset_t as the policy sent it, before noise and clipping, shape (N, T, d).
      lengths: samples of each trajectory, shape (N,): T, or less where the episode ended early.
      last_qpos, last_qvel: state of the whole scene at s_{T-1}, shapes (N, nq) and (N, nv). The physics goes on to
        there also where an episode ended early.
    """

    features: Array
    commands: Array
    lengths: NDArray[np.int64]
    last_qpos: Array
    last_qvel: Array


class Simulator:
    """A task's physics model with buffers for stepping it in batches. Threads must not share it."""

    def __init__(self, task: Task) -> None:
        self._task, self._scene = task, scene_of(task)
        self._entries = entries(task, *task.initial_state())

    @property
    def model(self) -> mujoco.MjModel:
        """The model that is stepped. Changes to it hold for the next rollouts."""
        return self._scene.model

    @property
    def command_range(self) -> tuple[Array, Array]:
        """The least and the greatest value of each command, shapes (d,); infinite where there is no limit."""
        limited = self.model.actuator_ctrllimited.astype(bool)
        low, high = self.model.actuator_ctrlrange.T
        return np.where(limited, low, -np.inf), np.where(limited, high, np.inf)

    def draw_command_noise(self, count: int, rng: np.random.Generator) -> Array:
        """The actuators' noise on the commands of `count` trajectories, shape (count, T, d)."""
        return draw_command_noise(self._task, (count, self._task.steps), rng)

    def draw_starts(self, count: int, rng: np.random.Generator) -> Array | None:
        """How far `count` trajectories start from the task's start, shape (count, nv); None where all start there."""
        return draw_starts(self._task, count, rng)

    def rollout(self, gain: Array, offsets: Array, command_noise: Array, starts: Array | None = None) -> Trajectories:
        """Simulates the policies u_t = K s_t + offset_t from the task's start.

        The last command is recorded but moves nothing: no sample comes after s_{T-1}.

        Args:
          gain: K, shape (d, n).
          offsets: k_t + exploration noise, shape (N, T, d), in the commands' unit.
          command_noise: the actuators' noise, shape (N, T, d), in the commands' unit.
          starts: how far the first M trajectories start from the task's start, shape (M, nv), rad or m.

        Raises:
          DivergedError: if the simulation diverged, naming the first trajectory and step that did.
        """
        task, scene, count = self._task, self._scene, self._scene.substeps
        n, steps, d = offsets.shape
        nq, nv = scene.model.nq, scene.model.nv
        features = np.empty((steps, n, task.width))
        commands = offsets.transpose(1, 0, 2).copy()  # the caller's array must not change
        noise = np.ascontiguousarray(command_noise.transpose(1, 0, 2))
        path = np.empty((steps, n, scene.start.size))  # the full physics states at the samples
        path[0] = scene.starting_states(n, starts)
        control = np.empty((n, count, d))
        fed_back = np.empty((n, d))
        states = np.empty((n, count, scene.start.size))
        sensors = np.empty((n, count, scene.model.nsensordata))
        models, data = [scene.model] * n, [scene.data]
        sensed, known = task.sensed, task.width
        if sensed is not None:
            forces = scene.sensors_at(path[0])
            known -= sensed(forces).shape[1]
        transposed_gain = np.ascontiguousarray(gain[:, :known].T)
        # Where K is on single positions and velocities alone, no features are needed before the end, and those of many
        # steps at once cost little. A feature that K does not read may then be anything, such as the time.
        needed = bool(transposed_gain[self._entries < 0].any())
        places, read = 1 + self._entries, np.empty((n, known))
        for t, (state, command) in enumerate(zip(path, commands, strict=True)):
            last = t + 1 == steps
            if needed:
                features[t, :, :known] = task.features(state[:, 1 : 1 + nq], state[:, 1 + nq : 1 + nq + nv])
                np.dot(features[t, :, :known], transposed_gain, out=fed_back)
            else:
                np.dot(state.take(places, axis=1, out=read, mode="clip"), transposed_gain, out=fed_back)
            command += fed_back  # a view of `commands`
            if last and sensed is None:
                break
            np.add(command[:, None], noise[t, :, None], out=control)
            after = states if last or count > 1 else path[t + 1, :, None]
            scene.rollout.rollout(
                models,
                data,
                state,
                control,
                nstep=count,
                skip_checks=True,
                state=after,
                sensordata=sensors,
            )
            if sensed is not None:
                # Sensors of the first physics step belong to the sample it began at, except for forces.
                features[t, :, known:] = sensed(np.where(scene.of_forces, forces, sensors[:, 0]))
                forces = sensors[:, -1].copy()
            if last:
                break  # this step was only for the sensors
            if after is states:
                path[t + 1] = states[:, -1]
        if not needed:
            for block in _blocks(steps, n):
                whole = path[block].reshape(-1, path.shape[2])
                found = task.features(whole[:, 1 : 1 + nq], whole[:, 1 + nq : 1 + nq + nv])
                features[block, :, :known] = found.reshape(-1, n, known)
        # Trajectories that end early were simulated to the end as well; they are cut here.
        ended = task.terminated(features.reshape(steps * n, -1)).reshape(steps, n)
        lengths = np.where(ended.any(axis=0), ended.argmax(axis=0) + 1, steps)
        for i in np.flatnonzero(lengths < steps):
            features[lengths[i] :, i] = features[lengths[i] - 1, i]
        times = scene.start[0] + task.control_timestep * np.arange(steps)
        if (where := _diverged(path, times, features, commands, commands + noise, lengths)) is not None:
            step, trajectory = where
            raise DivergedError(
                f"the simulation of {task.name} diverged: trajectory {trajectory}, step {step}, "
                f"{step * task.control_timestep:.3g} s",
                HELPS,
            )
        return Trajectories(
            features.transpose(1, 0, 2),
            commands.transpose(1, 0, 2),
            lengths,
            path[-1, :, 1 : 1 + nq],
            path[-1, :, 1 + nq : 1 + nq + nv],
        )
