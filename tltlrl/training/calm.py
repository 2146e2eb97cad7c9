"""A learned motion made calm, as motion planners simplify their paths: what decides nothing keeps no frozen noise.

The shortcuts of path planning (Geraerts and Overmars, Creating high-quality paths for motion planning, 2007; OMPL's
PathSimplifier) are taken on the commands. Pieces of them are replaced by smoother ones that lead to about the same
place, by coming to rest, or by the whole sequence smoothed here strongly and there hardly. A replacement stays if the
exact robustness stays above a share of the learned one, and with noise above 0.

Candidates are commands u, simulated without feedback: whatever the gain K is, the policy u_t + K (s'_t - s_t), with s
the motion that u leads to, moves the same without noise. So this works for every task and every feedback.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from tltlrl.learning.policy import Policy
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.trials import mean_motion
from tltlrl.tasks.task import Task
from tltlrl.training.build import Setup
from tltlrl.training.study import Run

Array = NDArray[np.float64]

PROPOSALS = 20  # simulated per batch
NOISY = 10  # trials that a replacement has to stand, all of them
SPEED = 0.03  # weight of a squared command beside a squared change of it, both as shares of a full command
DRAWS = 20  # per proposal that is wanted, at most: most cost more than what they replace, or are too fast
SPENDING = 0.7  # share of the batches over which the floor of the robustness sinks
FIXED = 1e6  # weight of what smoothing must not move


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
    proposals, spans = propose(now, low, high, PROPOSALS, rng)
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
    if len(proposals):
        _, robustness = rollout(0 * policy.gain, commands(proposals), np.zeros_like(commands(proposals)))
        good = np.flatnonzero(robustness >= least)
        order = good[np.argsort(cost(proposals[good]), kind="stable")]
        for candidate in candidates(now, proposals[order], [spans[i] for i in order], low, high):
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


def cost(commands: Array) -> Array:
    """Squared changes of the commands, from rest, and a little of their squares: (..., T, d) => (...)."""
    changes = np.diff(commands, axis=-2, prepend=0.0)
    return np.asarray((changes**2).sum((-1, -2)) + SPEED * (commands**2).sum((-1, -2)))


def candidates(now: Array, proposals: Array, spans: list[tuple[int, int]], low: Array, high: Array) -> list[Array]:
    """All proposals at once whose spans are disjoint, the calmest first, and the calmest alone."""
    if not len(proposals):
        return []
    taken, together = np.zeros(len(now), dtype=bool), now.copy()
    for proposal, (first, end) in zip(proposals, spans, strict=True):
        if not taken[first:end].any():
            taken[first:end] = True
            together += proposal - now
    return [together, proposals[0]] if within(together, low, high) else [proposals[0]]


def within(commands: Array, low: Array, high: Array) -> bool:
    """Whether no actuator would cut them."""
    return bool(np.all((commands >= low - 1e-12) & (commands <= high + 1e-12)))


def propose(
    commands: Array, low: Array, high: Array, count: int, rng: np.random.Generator
) -> tuple[Array, list[tuple[int, int]]]:
    """Calmer commands within the limits, each differing from `commands` mostly in one span.

    Args:
      commands: as shares of full ones, shape (T, d).
      low, high: the limits, shapes (d,).
      count: how many are wanted.
      rng: of all choices.

    Returns:
      At most `count` proposals, shape (N, T, d), and the half-open span of each.
    """
    steps = len(commands)
    found, spans = [], []
    for _ in range(DRAWS * count):
        length = int(np.exp(rng.uniform(np.log(3), np.log(steps + 1))))
        first = int(rng.integers(-(length // 2), steps - length // 2))
        first, end = max(first, 0), min(first + length, steps)
        kind = rng.random()
        if end == steps and kind < 0.3:
            proposal = resting(commands, first, int(rng.integers(1, 12)))
        elif kind < 0.5:
            proposal = bridged(commands, first, end)
        else:
            proposal = smoothed(commands, first, end, 10 ** rng.uniform(-9, -3), 10 ** rng.uniform(-3, 2))
        proposal = commands + (1.0 if rng.random() < 0.7 else rng.random()) * (proposal - commands)
        if rng.random() < 0.3:  # of one joint alone
            others = np.arange(commands.shape[1]) != rng.integers(commands.shape[1])
            proposal[:, others] = commands[:, others]
        if within(proposal, low, high) and cost(proposal) < (1 - 1e-6) * cost(commands):
            found.append(proposal)
            spans.append((first, end))
        if len(found) == count:
            break
    return np.array(found).reshape(-1, *commands.shape), spans


def resting(commands: Array, first: int, fading: int) -> Array:
    """At rest from `first` on, after the command before has faded in some steps."""
    result = commands.copy()
    result[first:] = 0.0
    before = commands[first - 1] if first else np.zeros(commands.shape[1])
    share = 1 - np.arange(1, fading + 1) / (fading + 1)
    faded = result[first : first + fading]
    faded += share[: len(faded), None] * before
    return result


def bridged(commands: Array, first: int, end: int) -> Array:
    """The span by a parabola between the commands beside it, with the sum that it had: a cubic of the path."""
    zero = np.zeros(commands.shape[1])
    before = commands[first - 1] if first else zero
    after = commands[end] if end < len(commands) else zero
    tau = np.arange(1, end - first + 1)[:, None] / (end - first + 1)
    line, arc = before + tau * (after - before), tau * (1 - tau)
    result = commands.copy()
    result[first:end] = line + arc * (commands[first:end].sum(axis=0) - line.sum(axis=0)) / arc.sum()
    return result


def smoothed(commands: Array, first: int, end: int, inside: float, outside: float) -> Array:
    """The commands whose sums x over time minimise sum (D^2 x)^2 + SPEED (D x)^2 + w (x - p)^2.

    p are the sums of the commands given (for commands of speeds the path), D is the difference of neighbours, and the
    weight w is `inside` in the span and `outside` elsewhere: Whittaker's smoother, 1923, with weights of its own.
    """
    sums = np.concatenate([np.zeros((2, commands.shape[1])), np.cumsum(commands, axis=0)])  # at rest before the start
    weights = np.full(len(sums), outside)
    weights[2 + first : 2 + end - 1] = inside
    weights[:2] = FIXED
    n = len(sums)
    bands = np.zeros((3, n))  # the upper diagonals of w + SPEED D'D + (D^2)'(D^2), the main one last
    bands[2] = weights
    for start, row, factor in ((0, (1.0, -2.0, 1.0), 1.0), (0, (-1.0, 1.0), SPEED)):
        reach = len(row)
        for i in range(reach):
            for j in range(i, reach):
                bands[2 - (j - i), start + j : n - reach + 1 + j] += factor * row[i] * row[j]
    x = solveh_banded(bands, weights[:, None] * sums)
    return np.asarray(np.diff(x[1:], axis=0))
