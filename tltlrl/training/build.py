"""From what is asked for to what is run: the registries give the task, the reward and the learner of a run.

Here the parts of a study meet, so here are the rules that need two of them.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from tltlrl.errors import UserError, nearest
from tltlrl.learning.learner import Learner
from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.simulation.rollout import Simulator
from tltlrl.tasks.task import StepReward, Task
from tltlrl.training.study import TLTL, AlgorithmConfig, Run, Study


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
    return Setup(task, Simulator(task), make_reward(run), make_learner(run))


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


def make_learner(run: Run) -> Learner[Any]:
    """The learner of a run's case.

    Raises:
      UserError: if its settings do not fit the number of samples.
    """
    learner: Learner[Any] = LEARNERS.get(run.case.learner)(run.learner, run.algorithm.samples)
    return learner


def first_policy(task: Task, algorithm: AlgorithmConfig) -> Policy:
    """u_t = u_ref_t + K (s_t - s_ref_t) + noise, the noise a share of each command's full size."""
    features, commands = task.reference()
    gain = algorithm.feedback * task.feedback
    covariance = np.diag((algorithm.initial_std * task.command_scale) ** 2)
    return Policy(gain, commands - features @ gain.T, np.tile(covariance, (task.steps, 1, 1)), algorithm.correlation)


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
    for run in first.values():
        make_learner(run)
        make_reward(run)
    task = make_task(study.task)
    _check_signals(study.spec, task)
    Simulator(task)


def cut_windows(study: Study) -> str | None:
    """Says that the spec looks beyond the end of an episode, if it does; what every window allows is checked above."""
    last, horizon = make_task(study.task).steps - 1, study.spec.horizon
    if horizon is None or horizon <= last:
        return None
    return f"the spec looks as far as step {horizon}, and an episode ends at step {last}: its windows are cut there"


def _check_signals(spec: Spec, task: Task) -> None:
    features, commands = task.reference()
    signals = task.signals(features[None], commands[None])
    offered = {name: None if values.ndim == 2 else values.shape[2] for name, values in signals.items()}
    for name, dimension in spec.signals.items():
        if name not in offered:
            raise UserError(f"spec: it needs a signal {name}, which {task.name} has not{nearest(name, offered)}")
        if dimension != offered[name]:
            raise UserError(
                f"spec: it reads {name} as {_kind(dimension)}, but in {task.name} it is {_kind(offered[name])}"
            )
    spec.check_length(signals)


def _kind(dimension: int | None) -> str:
    return "a scalar" if dimension is None else f"a vector of {dimension}"
