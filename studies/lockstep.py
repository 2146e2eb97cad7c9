"""Many runs of one task in lockstep: their trajectories are simulated as one batch.

For studies of the learner itself. A run here draws the same noise, with the same seeds, as one of `tltl-run`; only
the update is free. The physics is either the task's own (MuJoCo) or a kinematic model of the planar arm, in which the
servos are perfect: ten times faster, for screening.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.learning.reps import reward_to_go, solve_dual
from tltlrl.logic import Spec
from tltlrl.simulation.rollout import Simulator, Trajectories
from tltlrl.tasks.planar_arm.scene import forward_kinematics
from tltlrl.tasks.task import StepReward, Task

Array = NDArray[np.float64]
Fit = Callable[[Array, Array, Array, Array], tuple[Array, Array]]
"""offsets (N, T, d), weights (T, N), old mean (T, d) and covariance (T, d, d) => new mean and covariance."""


@dataclass(frozen=True)
class Learner:
    """One run.

    Attributes:
      seed: of all its noise.
      fit: how the policy follows from the weighted samples.
      epsilon: bound of the samples' KL, nats.
      reward: per step, or none for the spec's robustness.
      by_step: step-based REPS on the reward-to-go.
    """

    seed: int
    fit: Fit
    epsilon: float
    reward: StepReward | None = None
    by_step: bool = False


@dataclass(frozen=True)
class Curves:
    """Robustness of every run: of the samples' mean and of the mean policy, (iterations, runs), and of the last one.

    Attributes:
      samples: mean robustness of the sampled trajectories, shape (iterations, runs).
      policy: robustness of the noise-free mean policy that drew them, shape (iterations, runs).
      final: robustness of the mean policy after the last update, shape (runs,).
    """

    samples: Array
    policy: Array
    final: Array


class Kinematic(Simulator):
    """The planar arm with perfect servos: every angle moves by its clipped command times the control step."""

    def rollout(self, gain: Array, offsets: Array, command_noise: Array) -> Trajectories:
        """As `Simulator.rollout`; `gain` may act on the angles alone."""
        if np.any(gain[:, 3:]):
            raise ValueError("the kinematic model only takes feedback on the joint angles")
        config: Any = self._task.config
        n, steps, d = offsets.shape
        angles, velocities, commands = np.empty((steps, n, d)), np.zeros((steps, n, d)), np.empty((steps, n, d))
        angles[0] = config.start_angles
        noise, offsets = command_noise.transpose(1, 0, 2).copy(), offsets.transpose(1, 0, 2).copy()
        feedback = gain[:, :3].T.copy()
        for t in range(steps):
            commands[t] = angles[t] @ feedback + offsets[t]
            if t + 1 < steps:
                np.clip(commands[t] + noise[t], -config.max_speed, config.max_speed, out=velocities[t + 1])
                np.add(angles[t], self._task.control_timestep * velocities[t + 1], out=angles[t + 1])
        ee = forward_kinematics(angles, np.array(config.link_lengths))
        features = np.concatenate([angles, velocities, ee], axis=-1)
        return Trajectories(
            features.transpose(1, 0, 2), commands.transpose(1, 0, 2), np.full(n, steps), angles[-1], velocities[-1]
        )


def train(
    task: Task,
    spec: Spec,
    simulator: Simulator,
    start: Policy,
    learners: Sequence[Learner],
    samples: int,
    iterations: int,
) -> Curves:
    """Trains every learner from the policy `start`, with `samples` trajectories per iteration each."""
    policies = [start] * len(learners)
    still = np.zeros((1, *start.mean.shape))
    of_samples, of_policy = np.empty((2, iterations, len(learners)))
    for i in range(iterations):
        offsets, noise = [], []
        for learner, policy in zip(learners, policies, strict=True):
            rng = np.random.default_rng([learner.seed, i])
            offsets += [policy.sample(samples, rng), policy.mean[None]]
            noise += [simulator.draw_command_noise(samples, rng), still]
        drawn = np.concatenate(offsets)
        motion = simulator.rollout(start.gain, drawn, np.concatenate(noise))
        signals = task.signals(motion.features, motion.commands)
        robustness = spec.robustness(signals, motion.lengths).reshape(len(learners), samples + 1)
        of_samples[i], of_policy[i] = robustness[:, :-1].mean(axis=1), robustness[:, -1]
        for j, (learner, policy) in enumerate(zip(learners, policies, strict=True)):
            rows = slice(j * (samples + 1), j * (samples + 1) + samples)
            weights = _weights(learner, {k: v[rows] for k, v in signals.items()}, robustness[j, :-1], task.steps)
            mean, covariance = learner.fit(drawn[rows], weights, policy.mean, policy.covariance)
            policies[j] = Policy(start.gain, mean, covariance, start.correlation)
    means = np.stack([policy.mean for policy in policies])
    motion = simulator.rollout(start.gain, means, np.zeros_like(means))
    final = spec.robustness(task.signals(motion.features, motion.commands), motion.lengths)
    return Curves(of_samples, of_policy, final)


def _weights(learner: Learner, signals: dict[str, Array], robustness: Array, steps: int) -> Array:
    """Weights of the samples at every step, shape (T, N)."""
    if learner.reward is None:
        return np.tile(solve_dual(robustness, learner.epsilon).weights, (steps, 1))
    rewards, _ = learner.reward(signals)
    if learner.by_step:
        return solve_dual(reward_to_go(rewards).T, learner.epsilon).weights
    return np.tile(solve_dual(rewards.sum(axis=1), learner.epsilon).weights, (steps, 1))
