"""A learned motion made calm, as motion planners simplify their paths: what decides nothing keeps no frozen noise.

Shortcuts (`tltlrl.training.shortcuts`) are taken on the commands. One stays if the exact robustness stays above a share
of the learned one, and with noise above 0.

Candidates are commands u, simulated without feedback: whatever the gain K is, the policy u_t + K (s'_t - s_t), with s
the motion that u leads to, moves the same without noise. So this works for every task and every feedback.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.trials import mean_motion
from tltlrl.tasks.task import Task
from tltlrl.training.build import Setup
from tltlrl.training.shortcuts import shortcuts, together
from tltlrl.training.study import Run

Array = NDArray[np.float64]

PROPOSALS = 20  # simulated per batch
NOISY = 10  # trials that a replacement has to stand, all of them
SPEED = 0.03  # weight of a squared command beside a squared change of it, both as shares of a full command
SPENDING = 0.7  # share of the batches over which the floor of the robustness sinks


@dataclass(frozen=True)
class Calm:
    """How far a motion is simplified.

    Attributes:
      commands: of the motion, within the limits of the actuators, shape (T, d).
      offsets: k_t of the policy that follows it, shape (T, d).
      batches, episodes, env_steps: batches done, and the trajectories and samples simulated for them.
    """

    commands: Array
    offsets: Array
    batches: int
    episodes: int
    env_steps: int


def begin(setup: Setup, policy: Policy) -> Calm:
    """The learned mean motion as it is: commands beyond the actuators' limits were cut by them."""
    commands = np.clip(mean_motion(setup.simulator, policy).commands[0], *setup.simulator.command_range)
    return Calm(commands, policy.mean, 0, 0, 0)


def floor(learned: float, share: float, batch: int, batches: int) -> float:
    """The least robustness in a batch: it sinks from the learned one to a share of it, and then stays.

    At its end at once, the first long pieces would spend all of the margin where the motion is decided, and leave the
    changes of the command there as abrupt as they are.
    """
    return learned * (1 - (1 - share) * min(1.0, (batch + 1) / (SPENDING * batches)))


def calmer(run: Run, setup: Setup, policy: Policy, calm: Calm, least: float) -> Calm:
    """One batch of proposals; the calmest whose robustness is at least `least` stays, or disjoint ones together.

    Args:
      run: its seed and the batch's number are all that chance depends on.
      setup: task, simulator and limits.
      policy: the learned one.
      calm: as far as it is.
      least: robustness that has to be kept, positive; see `floor`.
    """
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials, calm.batches])
    joints = joint_commands(setup.task)
    scale = setup.task.command_scale[joints]
    now = calm.commands[:, joints] / scale
    low, high = (limit[joints] / scale for limit in setup.simulator.command_range)
    proposals = shortcuts(now, low, high, SPEED, PROPOSALS, rng)
    simulated: list[Trajectories] = []

    def commands(of_joints: Array) -> Array:
        whole = np.broadcast_to(calm.commands, (len(of_joints), *calm.commands.shape)).copy()
        whole[..., joints] = of_joints * scale
        return whole

    def rollout(gain: Array, offsets: Array, noise: Array) -> tuple[Trajectories, Array]:
        motion = setup.simulator.rollout(gain, offsets, noise)
        simulated.append(motion)
        signals = setup.task.signals(motion.features, motion.commands)
        return motion, run.spec.robustness(signals, motion.lengths)

    kept = calm
    if proposals:
        sent = commands(np.stack([proposal.speeds for proposal in proposals]))
        _, robustness = rollout(0 * policy.gain, sent, np.zeros_like(sent))
        good = sorted((proposals[i] for i in np.flatnonzero(robustness >= least)), key=lambda proposal: proposal.cost)
        for candidate in [together(good, now), good[0].speeds] if good else []:
            sent = commands(candidate[None])
            motion, _ = rollout(0 * policy.gain, sent, np.zeros_like(sent))
            offsets = sent[0] - motion.features[0] @ policy.gain.T
            noise = setup.simulator.draw_command_noise(1 + NOISY, rng)
            noise[0] = 0
            _, robustness = rollout(policy.gain, np.broadcast_to(offsets, noise.shape), noise)
            if robustness[0] >= least and robustness.min() > 0:
                kept = Calm(sent[0], offsets, 0, 0, 0)
                break
    episodes = sum(len(motion.lengths) for motion in simulated)
    env_steps = sum(int(motion.lengths.sum()) for motion in simulated)
    return Calm(kept.commands, kept.offsets, calm.batches + 1, calm.episodes + episodes, calm.env_steps + env_steps)


def simplified(
    run: Run, setup: Setup, policy: Policy, robustness: float, share: float, batches: int, start: Calm
) -> Iterator[Calm]:
    """The motion of a learned policy after each batch.

    Args:
      run, setup: of the policy.
      policy: the learned one.
      robustness: of its mean motion, positive.
      share: of it that has to be kept.
      batches: how many in all.
      start: where it was stopped, or how it begins.

    Yields:
      How far it is, first as it starts.
    """
    calm = start
    yield calm
    while calm.batches < batches:
        calm = calmer(run, setup, policy, calm, floor(robustness, share, calm.batches, batches))
        yield calm


def calm_policy(policy: Policy, calm: Calm) -> Policy:
    """The policy that follows a calm motion with the learned one's feedback, and explores no more."""
    return Policy(policy.gain, calm.offsets, np.zeros_like(policy.covariance), policy.correlation)


def joint_commands(task: Task) -> slice:
    """Which commands move joints; all of them, unless the task says which."""
    return slice(None) if task.joints is None else task.command_slices[task.joints.speeds]
