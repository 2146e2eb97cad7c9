"""Learned motions made calm: what decides nothing keeps the noise that it was learned with, until it is smoothed out.

Batches of shortcuts (`tltlrl.training.shortcuts`) of the mean motion's commanded speeds are simulated. Those that keep
the exact robustness above a share of the learned one are taken, all together where they may, if the policy that follows
the changed motion satisfies the spec under the actuators' noise as well.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.trials import mean_motion, trials
from tltlrl.training.build import Setup
from tltlrl.training.shortcuts import shortcuts, together
from tltlrl.training.study import Run

Array = NDArray[np.float64]

BATCH = 20  # proposals
SHARE = 0.7  # of the learned robustness, which has to stay
NOISY = 10  # trajectories with the actuators' noise, all of which have to satisfy the spec
RATE = 3.0  # 1/s: a full speed costs as much as a change by a full speed within 1/RATE


@dataclass(frozen=True)
class Calm:
    """What became of a learned policy.

    Attributes:
      policy: the same feedback and exploration about the calm motion.
      episodes: trajectories that it took, the noisy ones included.
    """

    policy: Policy
    episodes: int


def calmed(run: Run, setup: Setup, policy: Policy) -> Calm | None:
    """A learned policy after `run.algorithm.calm` batches; None if it does not satisfy its spec, or only by commands
    beyond what the actuators can do.

    Args:
      run: that learned it; the shortcuts are chosen by a generator of its seed.
      setup: of the run; its task names its joints.
      policy: learned by the run.
    """
    task, simulator, dt = setup.task, setup.simulator, setup.task.control_timestep
    assert task.joints is not None
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, 0])
    moved = task.command_slices[task.joints.speeds]
    scale = task.command_scale[moved]
    low, high = simulator.command_range
    episodes = 0

    def robustness(motion: Trajectories) -> Array:
        nonlocal episodes
        episodes += len(motion.lengths)
        return run.spec.robustness(task.signals(motion.features, motion.commands), motion.lengths)

    def open_loop(candidates: list[Array]) -> Trajectories:
        commands = np.repeat(start[None], len(candidates), axis=0)
        commands[:, :-1, moved] = np.stack(candidates) * scale  # the last command moves nothing
        return simulator.rollout(np.zeros_like(policy.gain), commands, np.zeros_like(commands))

    motion = mean_motion(simulator, policy)
    least = SHARE * robustness(motion)[0]
    start = np.clip(motion.commands[0], low, high)
    start[-1, moved] = 0.0
    speeds = start[:-1, moved] / scale
    motion = open_loop([speeds])
    if least <= 0 or robustness(motion)[0] < least:
        return None
    for _ in range(run.algorithm.calm):
        found = shortcuts(speeds, low[moved] / scale, high[moved] / scale, (RATE * dt) ** 2, BATCH, rng)
        if not found:
            continue
        kept = robustness(open_loop([shortcut.speeds for shortcut in found])) >= least
        good = sorted((shortcut for shortcut, keep in zip(found, kept, strict=True) if keep), key=lambda s: s.cost)
        if not good:
            continue
        candidates = [together(good, speeds), good[0].speeds]
        changed = open_loop(candidates)
        for i in np.flatnonzero(robustness(changed) >= least)[:1]:
            following = _following(policy, changed, i)
            if np.all(robustness(trials(simulator, following, NOISY, rng)) > 0):
                speeds, motion = candidates[i], open_loop([candidates[i]])
    return Calm(_following(policy, motion, 0), episodes)


def _following(policy: Policy, motion: Trajectories, i: int) -> Policy:
    """The policy about one of some motions."""
    return dataclasses.replace(policy, mean=motion.commands[i] - motion.features[i] @ policy.gain.T)
