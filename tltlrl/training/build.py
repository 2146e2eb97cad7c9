"""Builds the task, the reward and the learner of a run from their names and settings.

The parts of a study meet here, so the rules that need two parts are here.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.learning.basis import Basis
from tltlrl.learning.learner import Learner
from tltlrl.learning.policy import Policy
from tltlrl.learning.scores import leximin
from tltlrl.logic import Spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.simulation.outside import unlike
from tltlrl.simulation.probe import ranges_seen
from tltlrl.simulation.simulator import Simulates, simulator_of
from tltlrl.simulation.trials import mean_motion
from tltlrl.store.files import arrays_in
from tltlrl.store.run import UNREADABLE
from tltlrl.tasks.fits import check_fits
from tltlrl.tasks.task import Signals, StepReward, Task
from tltlrl.training.study import TLTL, AlgorithmConfig, Run, Stage, Study

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


@dataclass(frozen=True)
class Samples:
    """The draws for the simulations of one iteration.

    Attributes:
      policy: the policy that the offsets were drawn from.
      offsets: offsets of the N samples and, last, of the mean policy, shape (N + 1, T, d).
      noise: the actuators' noise, shape (N + 1, T, d); 0 for the mean policy.
      starts: how far the N samples start from the task's start, shape (N, nv); None where all start there.
    """

    policy: Policy
    offsets: Array
    noise: Array
    starts: Array | None


def draw(run: Run, learner: Learner[Any], simulator: Simulates, state: Any, iteration: int) -> Samples:
    """Draws the samples of an iteration. They depend only on its number, the seed and the learner's state."""
    rng = np.random.default_rng([run.seed, iteration])
    policy = learner.policy(state)
    offsets = np.concatenate([learner.ask(state, run.algorithm.samples, rng), policy.mean[None]])
    noise = np.concatenate(
        [simulator.draw_command_noise(run.algorithm.samples, rng), np.zeros((1, *policy.mean.shape))]
    )
    return Samples(policy, offsets, noise, simulator.draw_starts(run.algorithm.samples, rng))


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


def policy_of(saved: Mapping[str, NDArray[np.generic]]) -> Policy:
    """The policy made of its saved arrays, name => array.

    Raises:
      KeyError, ValueError, TypeError: if the arrays make no policy.
    """
    gain, mean, covariance = (saved[name].astype(np.float64) for name in ("gain", "mean", "covariance"))
    (steps, d) = mean.shape
    if gain.shape[0] != d or gain.ndim != 2 or covariance.shape != (steps, d, d):
        raise ValueError(f"arrays of the shapes {gain.shape}, {mean.shape} and {covariance.shape} are no policy")
    return Policy(gain, mean, covariance, float(saved["correlation"]))


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


def check(study: Study) -> None:
    """Checks that the parts of a study fit together, by building each of them once.

    Raises:
      UserError: if a key or a signal does not fit; it names it.
    """
    names = [field.name for field in dataclasses.fields(study.reward) if field.name != "step"]
    for name in study.reward.step:
        if name not in names:
            raise UserError(f"reward.step.{name}: no such key{nearest(name, names)}")
    for case in study.cases:
        if case.reward == TLTL and LEARNERS.get(case.learner).by_step and study.algorithm.told == "leximin":
            raise UserError(
                f"algorithm.told: leximin is a rank among whole trajectories, and {case.name} learns step by step; "
                "expected robustness; set it, or leave the case out"
            )
    first = {run.case: run for run in reversed(study.runs())}
    task = make_task(study.task)
    for run in first.values():
        for stage in filter(None, (run.stage(0), run.refine)):
            make_learner(run, stage).start(first_policy(task, stage.algorithm))
        make_reward(run)
    check_fits(study.spec, task)
    simulator_of(task)
    if study.task.name in TASKS.described and task.outside is None:  # a model that the user brought
        ranges_seen(task, np.random.default_rng(0))
        make_evaluation_task(study.task)


def unlike_resets(study: Study) -> str | None:
    """A warning if an environment differs after two resets with the same seed; None if it does not."""
    task = make_task(study.task)
    if task.outside is None or (where := unlike(task, task.outside)) is None:
        return None
    return (
        f"two resets of {study.task.id} with one seed differ in {where}: the same command will not give the same "
        "bytes, and what is resumed is not what it would have been"
    )


def cut_windows(study: Study) -> str | None:
    """A warning if the spec looks beyond the end of an episode; None if not. `check` refuses what no window allows."""
    last, horizon = make_task(study.task).steps - 1, study.spec.horizon
    if horizon is None or horizon <= last:
        return None
    return f"the spec looks as far as step {horizon}, and an episode ends at step {last}: its windows are cut there"
