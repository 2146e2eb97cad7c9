"""Simulates an environment that steps by itself, one trajectory after the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.simulation.rollout import DivergedError, Trajectories
from tltlrl.tasks.task import Outside, Task, draw_command_noise

Array = NDArray[np.float64]
SEEDS = 2**31  # of starts
FEW = 10  # steps


class OutsideSimulator:
    """Makes trajectories of an environment, in place of `tltlrl.simulation.rollout.Simulator`."""

    def __init__(self, task: Task, outside: Outside) -> None:
        self._task, self._outside = task, outside
        self._env = outside.make(False)

    @property
    def command_range(self) -> tuple[Array, Array]:
        """The least and the greatest value of each command, shapes (d,)."""
        return self._outside.command_range

    def draw_command_noise(self, count: int, rng: np.random.Generator) -> Array:
        """Noise to add to the commands of `count` trajectories, shape (count, T, d)."""
        return draw_command_noise(self._task, (count, self._task.steps), rng)

    def draw_starts(self, count: int, rng: np.random.Generator) -> Array | None:
        """The seeds of the starts of `count` trajectories, shape (count, 1); None where all start alike."""
        if self._outside.seed is not None:
            return None
        return rng.integers(SEEDS, size=(count, 1)).astype(np.float64)

    def rollout(self, gain: Array, offsets: Array, command_noise: Array, starts: Array | None = None) -> Trajectories:
        """Simulates the policies u_t = K s_t + offset_t; commands are cut to their bounds.

        Args:
          gain: K, shape (d, n).
          offsets: shape (N, T, d), in the commands' unit.
          command_noise: noise added to the commands, shape (N, T, d).
          starts: seeds of the first M starts, shape (M, 1); the others start from the task's own seed, or from 0.

        Raises:
          DivergedError: if it diverged, or an observation, a reward or a command is not finite, naming the first
            trajectory and step.
        """
        task, (n, steps, _) = self._task, offsets.shape
        features, commands = np.empty((n, steps, task.width)), offsets.copy()
        lengths = np.full(n, steps)
        for i in range(n):
            seed = self._outside.seed or 0 if starts is None or i >= len(starts) else int(starts[i, 0])
            features[i, 0] = np.append(self._env.reset(seed), 0.0)
            for t in range(steps):
                commands[i, t] += gain @ features[i, t]
                if not (np.isfinite(features[i, t]).all() and np.isfinite(commands[i, t]).all()):
                    raise self._diverged(i, t)
                if t + 1 == lengths[i]:
                    features[i, t + 1 :] = features[i, t]
                    features[i, t + 1 :, -1] = 0.0  # no reward after the end
                    break
                command = np.clip(commands[i, t] + command_noise[i, t], *self.command_range)
                try:
                    observed, reward, over = self._env.step(command)
                except FloatingPointError:
                    raise self._diverged(i, t + 1) from None
                features[i, t + 1] = np.append(observed, reward)
                if over:
                    lengths[i] = t + 2
        return Trajectories(features, commands, lengths, np.zeros((n, 0)), np.zeros((n, 0)))

    def _diverged(self, trajectory: int, step: int) -> DivergedError:
        task, seconds = self._task, step * self._task.control_timestep
        return DivergedError(f"{task.name} diverged: trajectory {trajectory}, step {step}, {seconds:.3g} s")


def unlike(task: Task, outside: Outside) -> str | None:
    """Where observations differ after two resets with the same seed and a few same steps; None if nowhere."""
    rng = np.random.default_rng(0)
    low, high = outside.command_range
    commands = rng.uniform(low, high, (min(FEW, task.steps - 1), len(low)))
    env, seen = outside.make(False), []
    for one in (env, env, outside.make(False)):
        path = [np.append(one.reset(outside.seed or 0), 0.0)]
        for command in commands:
            observed, reward, over = one.step(command)
            path.append(np.append(observed, reward))
            if over:
                break
        seen.append(np.array(path))
    names = [part for group in task.observation for part in group.parts]
    for other in seen[1:]:
        same = min(len(other), len(seen[0]))
        wrong = np.argwhere(~np.isclose(other[:same], seen[0][:same], rtol=0, atol=0, equal_nan=True))
        if wrong.size:
            step, part = wrong[0]
            return f"{names[part]} at step {step}"
        if len(other) != len(seen[0]):
            return "how long an episode is"
    return None
