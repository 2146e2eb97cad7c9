"""Makes a learned motion calm, as motion planners simplify their paths: removes movement that the spec does not need.

The method tries shortcuts (`tltlrl.training.shortcuts`) of the commands. A shortcut stays if the exact robustness stays
above a share of the learned robustness, and if the robustness with noise, from random starts where the task has them,
stays above 0.

Proposals are commands u, simulated without feedback. Let s be the motion that u leads to. Without noise, the policy
u_t + K (s'_t - s_t) makes the same motion for any gain K. So this works for every task and every feedback.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.trials import mean_motion, starts_after_the_first
from tltlrl.tasks.task import Task
from tltlrl.training.build import Setup
from tltlrl.training.shortcuts import shortcuts, together
from tltlrl.training.study import Run

Array = NDArray[np.float64]

PROPOSALS = 20  # simulated per batch
NOISY = 10  # trials, all of which must satisfy the spec
STRAIGHTNESS = 1.0, 0.06  # first and last weight of squared commands against squared changes of commands
SPENDING = 0.7  # share of the batches over which the floor of the robustness, and that weight, sink


@dataclass(frozen=True)
class Calm:
    """How far a motion is simplified.

    Attributes:
      commands: commands of the motion, within the actuators' limits, shape (T, d).
      offsets: k_t of the policy that follows the motion, shape (T, d).
      events: steps of the motion at which a predicate of the spec becomes true or false, rising, shape (e,).
      batches, episodes, env_steps: batches done, and trajectories and samples simulated for them.
    """

    commands: Array
    offsets: Array
    events: NDArray[np.int64]
    batches: int
    episodes: int
    env_steps: int


def begin(run: Run, setup: Setup, policy: Policy) -> Calm:
    """The state before the first batch: the learned mean motion, with commands cut to the actuators' limits."""
    motion = mean_motion(setup.simulator, policy)
    commands = np.clip(motion.commands[0], *setup.simulator.command_range)
    return Calm(commands, policy.mean, events(run.spec, setup.task, motion), 0, 0, 0)


def events(spec: Spec, task: Task, motion: Trajectories) -> NDArray[np.int64]:
    """The steps at which a predicate of the spec becomes true or false on a single trajectory, rising, shape (e,)."""
    margins = spec.predicates_over_time(task.signals(motion.features, motion.commands), motion.lengths)
    changes = [np.diff(margin[0, : motion.lengths[0]] > 0) for margin in margins.values()]
    return 1 + np.flatnonzero(np.any(changes, axis=0))


def floor(learned: float, share: float, batch: int, batches: int) -> float:
    """The least robustness allowed in a batch: it sinks from the learned robustness to a share of it, and then stays.

    If it were low from the start, the first long shortcuts would use up the whole margin at the samples that decide.
    Commands would then stay as abrupt there as they are.
    """
    return learned * (1 - (1 - share) * min(1.0, (batch + 1) / (SPENDING * batches)))


def straightness(batch: int, batches: int) -> float:
    """The weight of the squared commands in a batch: it sinks geometrically, and then stays.

    So the path becomes short first and even afterwards. With the last weight from the start, the path would be smoothed
    where it lies and would stay long: abrupt commands cost far more than length.
    """
    first, last = STRAIGHTNESS
    return float(first * (last / first) ** min(1.0, batch / (SPENDING * batches)))


def calmer(run: Run, setup: Setup, policy: Policy, calm: Calm, least: float, straight: float) -> Calm:
    """The motion after one more batch of proposals.

    The calmest proposal whose robustness is at least `least` is taken, or several together that change other steps.

    Args:
      run: its seed and the batch's number decide all random numbers.
      setup: task, simulator and limits.
      policy: the learned policy.
      calm: the motion so far.
      least: the least robustness allowed, positive; see `floor`.
      straight: the weight of the squared commands; see `straightness`.
    """
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials, calm.batches])
    joints = setup.task.joint_commands
    scale = setup.task.command_scale[joints]
    now = calm.commands[:, joints] / scale
    low, high = (limit[joints] / scale for limit in setup.simulator.command_range)
    proposals = shortcuts(now, calm.events.tolist(), low, high, straight, PROPOSALS, rng)
    simulated: list[Trajectories] = []

    def commands(of_joints: Array) -> Array:
        whole = np.broadcast_to(calm.commands, (len(of_joints), *calm.commands.shape)).copy()
        whole[..., joints] = of_joints * scale
        return whole

    def rollout(gain: Array, offsets: Array, noise: Array, starts: Array | None = None) -> tuple[Trajectories, Array]:
        motion = setup.simulator.rollout(gain, offsets, noise, starts)
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
            starts = starts_after_the_first(setup.simulator, NOISY, rng)
            _, robustness = rollout(policy.gain, np.broadcast_to(offsets, noise.shape), noise, starts)
            if robustness[0] >= least and robustness.min() > 0:
                kept = Calm(sent[0], offsets, events(run.spec, setup.task, motion), 0, 0, 0)
                break
    episodes = sum(len(motion.lengths) for motion in simulated)
    env_steps = sum(int(motion.lengths.sum()) for motion in simulated)
    return replace(
        kept,
        batches=calm.batches + 1,
        episodes=calm.episodes + episodes,
        env_steps=calm.env_steps + env_steps,
    )


def simplified(
    run: Run, setup: Setup, policy: Policy, robustness: float, share: float, batches: int, start: Calm
) -> Iterator[Calm]:
    """The motion of a learned policy after each batch.

    Args:
      run, setup: the run that learned the policy.
      policy: the learned policy.
      robustness: robustness of its mean motion, positive.
      share: share of that robustness that has to be kept.
      batches: batches in all.
      start: the state of an earlier session, or of `begin`.

    Yields:
      The motion so far, first `start` itself.
    """
    calm = start
    yield calm
    while calm.batches < batches:
        least, straight = floor(robustness, share, calm.batches, batches), straightness(calm.batches, batches)
        calm = calmer(run, setup, policy, calm, least, straight)
        yield calm


def calm_policy(policy: Policy, calm: Calm) -> Policy:
    """The policy that follows a calm motion with the learned policy's feedback, without exploration."""
    return Policy(policy.gain, calm.offsets, np.zeros_like(policy.covariance), policy.correlation)
