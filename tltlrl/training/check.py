"""Checks that the parts of a study fit together: the rules that need two of them."""

from __future__ import annotations

import dataclasses

import numpy as np

from tltlrl.errors import UserError, nearest
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.simulation.outside import unlike
from tltlrl.simulation.probe import ranges_seen
from tltlrl.simulation.simulator import simulator_of
from tltlrl.tasks.fits import check_fits
from tltlrl.training.build import make_evaluation_task, make_learner, make_reward, make_task
from tltlrl.training.start import first_policy
from tltlrl.training.study import TLTL, Study, in_second_stage


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
        make_learner(run, run.stage(0)).start(first_policy(task, run.algorithm))
        if run.refine is not None:
            with in_second_stage(study.algorithm.refine):
                make_learner(run, run.refine).start(first_policy(task, run.refine.algorithm))
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
