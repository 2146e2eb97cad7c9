"""Builds the task, the reward and the learner of a run from their names and settings."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.learning.basis import Basis
from tltlrl.learning.learner import Learner
from tltlrl.learning.scores import leximin
from tltlrl.logic import Spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.simulation.simulator import Simulates, simulator_of
from tltlrl.tasks.task import Signals, StepReward, Task
from tltlrl.training.draw import draw
from tltlrl.training.start import first_policy
from tltlrl.training.study import TLTL, Run, Stage

Array = NDArray[np.float64]
Returns = Callable[[Signals, NDArray[np.int64]], Array]


@dataclass(frozen=True)
class Setup:
    """The parts of a run, built from its description.

    Attributes:
      task: what is simulated.
      simulator: makes trajectories of that task.
      reward: the hand-made reward that the run is trained on; None for the spec's robustness.
      learner: what improves the policy.
      told: the spec whose values the learner is told: the run's own, or the same with normalised predicates.
      returns: (signals, lengths) => the returns that the learner is told; None for those of the hand-made reward, and
        for the robustness of the run's own spec, which is known anyway.
    """

    task: Task
    simulator: Simulates
    reward: StepReward | None
    learner: Learner[Any]
    told: Spec
    returns: Returns | None


def set_up(run: Run) -> Setup:
    """Builds everything that training needs.

    Raises:
      UserError: if the spec lacks what the hand-made reward needs, or the learner's settings do not fit.
    """
    task = make_task(run.task)
    simulator, learner = simulator_of(task), make_learner(run, run.stage(0))
    told = run.spec
    if run.algorithm.normalise and run.case.reward == TLTL:
        drawn = draw(run, learner, simulator, learner.start(first_policy(task, run.algorithm)), 0)
        motions = simulator.rollout(drawn.policy.gain, drawn.offsets, drawn.noise, drawn.starts)
        told = told.normalised(task.signals(motions.features, motions.commands), motions.lengths)
    return Setup(task, simulator, make_reward(run), learner, told, _returns(run, told))


def _returns(run: Run, told: Spec) -> Returns | None:
    if run.case.reward == TLTL and run.algorithm.told == "leximin":
        return lambda signals, lengths: leximin(told.conjuncts(signals, lengths))
    return None if told is run.spec else told.robustness


def make_task(config: Any) -> Task:
    """The task of training, from its config."""
    task: Task = TASKS.get(config.name).make(config)
    return task


def make_evaluation_task(config: Any) -> Task:
    """The task that learned policies are evaluated on: the same, or a more realistic scene if the task has one."""
    entry = TASKS.get(config.name)
    task: Task = entry.make(entry.evaluation(config))
    return task


def make_reward(run: Run) -> StepReward | None:
    """The hand-made reward that a run is trained on; None if it is trained on the spec's robustness.

    The config may give step-based learners other coefficients (`reward.step`).

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
