"""From what is asked for to what is run: the registries give the task, the reward and the learner of a run.

Here the parts of a study meet, so here are the rules that need two of them.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.learning.basis import Basis
from tltlrl.learning.learner import Learner
from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.tasks.task import StepReward, Task
from tltlrl.training.study import TLTL, AlgorithmConfig, Run, Stage, Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Setup:
    """What a run works with, built from its description.

    Attributes:
      task: what is simulated.
      simulator: of that task.
      reward: the hand-made reward it is trained on; None for the spec's robustness.
      learner: what improves the policy.
    """

    task: Task
    simulator: Simulator
    reward: StepReward | None
    learner: Learner[Any]


def set_up(run: Run) -> Setup:
    """Everything that training needs.

    Raises:
      UserError: if the spec lacks what the hand-made reward needs, or the learner's settings do not fit.
    """
    task = make_task(run.task)
    return Setup(task, Simulator(task), make_reward(run), make_learner(run, run.stage(0)))


def make_task(config: Any) -> Task:
    """The task of training, from its config."""
    task: Task = TASKS.get(config.name).make(config)
    return task


def make_evaluation_task(config: Any) -> Task:
    """The task as learned policies are tried on it: the same, or a more truthful scene if the task has one."""
    entry = TASKS.get(config.name)
    task: Task = entry.make(entry.evaluation(config))
    return task


def make_reward(run: Run) -> StepReward | None:
    """The hand-made reward that a run is trained on; None if that is the spec's robustness.

    Step-based learners have coefficients of their own where the config gives them (`reward.step`).

    Raises:
      UserError: if the spec lacks constants that the reward needs.
    """
    if run.case.reward == TLTL:
        return None
    own = run.reward.step if LEARNERS.get(run.case.learner).by_step else {}
    rewards = TASKS.get(run.task.name).rewards(dataclasses.replace(run.reward, **own), run.spec.constants)
    reward: StepReward = rewards[run.case.reward]
    return reward


def make_learner(run: Run, stage: Stage) -> Learner[Any]:
    """The learner of a run's case, with the settings of one of its stages.

    Raises:
      UserError: if they do not fit the number of samples, or the learner.
    """
    kind, functions = LEARNERS.get(run.case.learner), stage.algorithm.basis
    learner: Learner[Any] = kind(stage.learner, run.algorithm.samples)
    if functions and kind.by_step:
        raise UserError(
            f"algorithm.basis: {run.case.name} learns from the rewards of single steps, and weights of basis functions "
            "belong to no step; leave it 0, or leave the case out"
        )
    return Basis(learner, functions) if functions else learner


def first_policy(task: Task, algorithm: AlgorithmConfig) -> Policy:
    """u_t = u_ref_t + K (s_t - s_ref_t) + noise, about the task's reference motion."""
    return policy_about(*task.reference(), task, algorithm)


def refined_policy(setup: Setup, policy: Policy, algorithm: AlgorithmConfig) -> Policy:
    """The same about the mean motion of a policy that was learned: K may be another one.

    Commands beyond what the actuators can do are cut to it, so that exploration about them is felt.
    """
    motion = mean_motion(setup.simulator, policy)
    commands = np.clip(motion.commands[0], *setup.simulator.command_range)
    return policy_about(motion.features[0], commands, setup.task, algorithm)


def policy_about(features: Array, commands: Array, task: Task, algorithm: AlgorithmConfig) -> Policy:
    """u_t = u_ref_t + K (s_t - s_ref_t) + noise, the noise a share of each command's full size.

    Args:
      features, commands: s_ref, shape (T, n), and u_ref, shape (T, d).
      task, algorithm: of which K and the noise are.

    Raises:
      UserError: if the exploration of commands is given that the task has not.
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


def check(study: Study) -> None:
    """Whether the parts of a study go together; builds each of them once.

    Raises:
      UserError: naming the key or the signal that does not fit.
    """
    names = [field.name for field in dataclasses.fields(study.reward) if field.name != "step"]
    for name in study.reward.step:
        if name not in names:
            raise UserError(f"reward.step.{name}: no such key{nearest(name, names)}")
    first = {run.case: run for run in reversed(study.runs())}
    task = make_task(study.task)
    for run in first.values():
        for stage in filter(None, (run.stage(0), run.refine)):
            make_learner(run, stage)
            first_policy(task, stage.algorithm)
        make_reward(run)
    if study.algorithm.calm and task.joints is None:
        raise UserError(f"algorithm.calm: {task.name} does not say what its joints are (Task.joints); leave it 0")
    _check_signals(study.spec, task)
    task.make_physics()


def _check_signals(spec: Spec, task: Task) -> None:
    features, commands = task.reference()
    offered = {
        name: None if values.ndim == 2 else values.shape[2]
        for name, values in task.signals(features[None], commands[None]).items()
    }
    for name, dimension in spec.signals.items():
        if name not in offered:
            raise UserError(f"spec: it needs a signal {name}, which {task.name} has not{nearest(name, offered)}")
        if dimension != offered[name]:
            raise UserError(
                f"spec: it reads {name} as {_kind(dimension)}, but in {task.name} it is {_kind(offered[name])}"
            )


def _kind(dimension: int | None) -> str:
    return "a scalar" if dimension is None else f"a vector of {dimension}"
