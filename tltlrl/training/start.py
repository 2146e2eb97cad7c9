"""The policies that a run and its second stage begin with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.learning.policy import Policy
from tltlrl.simulation.simulator import Simulates, simulator_of
from tltlrl.simulation.trials import mean_motion
from tltlrl.store.files import arrays_in
from tltlrl.store.run import UNREADABLE
from tltlrl.tasks.task import Task
from tltlrl.training.learned import policy_of
from tltlrl.training.study import AlgorithmConfig

Array = NDArray[np.float64]


def first_policy(task: Task, algorithm: AlgorithmConfig) -> Policy:
    """The first policy, about the task's reference motion or about the mean of the policy in `algorithm.policy`.

    It is u_t = u_ref_t + K (s_t - s_ref_t) + noise.

    Raises:
      UserError: if `algorithm.policy` is no policy, or the policy of another task.
    """
    if (start := algorithm.start()) is None:
        return policy_about(*task.reference(), task, algorithm)
    try:
        policy = policy_of(arrays_in(start))
    except UNREADABLE as error:
        raise UserError(f"algorithm.policy: {algorithm.policy} is no policy.npz ({error})") from error
    d, n = policy.gain.shape
    if (n, policy.mean.shape) != (task.width, (task.steps, len(task.command_scale))):
        raise UserError(
            f"algorithm.policy: {algorithm.policy} is a policy of {n} features, {d} commands and {len(policy.mean)} "
            f"steps; {task.name} has {task.width}, {len(task.command_scale)} and {task.steps}; give one of this task"
        )
    return refined_policy(task, simulator_of(task), policy, algorithm)


def refined_policy(task: Task, simulator: Simulates, policy: Policy, algorithm: AlgorithmConfig) -> Policy:
    """The first policy of a stage, about the mean motion of the policy learned so far; K may differ from before.

    Commands are cut to the actuators' limits. Beyond the limits, exploration would change nothing.
    """
    motion = mean_motion(simulator, policy)
    commands = np.clip(motion.commands[0], *simulator.command_range)
    return policy_about(motion.features[0], commands, task, algorithm)


def policy_about(features: Array, commands: Array, task: Task, algorithm: AlgorithmConfig) -> Policy:
    """u_t = u_ref_t + K (s_t - s_ref_t) + noise, the noise a share of each command's full size.

    Args:
      features, commands: s_ref, shape (T, n), and u_ref, shape (T, d).
      task, algorithm: K and the noise follow from them.

    Raises:
      UserError: if the config gives the exploration of a command that the task does not have.
    """
    gain = algorithm.feedback * task.feedback
    covariance = np.diag((_exploration(task, algorithm) * task.command_scale) ** 2)
    return Policy(gain, commands - features @ gain.T, np.tile(covariance, (task.steps, 1, 1)), algorithm.correlation)


def _exploration(task: Task, algorithm: AlgorithmConfig) -> Array:
    groups = [group.name for group in task.action]
    for name in algorithm.exploration:
        if name not in groups:
            raise UserError(f"algorithm.exploration.{name}: {task.name} has no such commands{nearest(name, groups)}")
    return np.concatenate(
        [
            np.full(len(group.parts), algorithm.exploration.get(group.name, algorithm.initial_std))
            for group in task.action
        ]
    )
