"""`tltl evaluate RUN`: trials of a learned policy, in the evaluation scene, and their success rate."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from tltlrl.errors import UserError
from tltlrl.experiments.experiment import open_run
from tltlrl.learning.policy import Policy
from tltlrl.simulation.motion import MEASURES, measures
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.training.build import make_task
from tltlrl.training.session import calm_policy
from tltlrl.training.study import MOST_TRIALS, Run
from tltlrl.training.verdict import try_policy


def add_parser(subparsers: Any, about: str) -> None:
    """Adds `evaluate` to a parser's sub-commands."""
    parser = subparsers.add_parser("evaluate", help=about, description=__doc__)
    parser.add_argument("run", type=Path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    parser.add_argument("--trials", type=int, default=10, help="how many (default 10, as in the case study)")
    parser.add_argument("--seed", type=int, default=0, help="of the actuators' noise (default 0)")
    parser.set_defaults(command=evaluate)


def evaluate(arguments: Namespace) -> int:
    """The sub-command; returns its exit code.

    Raises:
      UserError: if there is no finished run, or the numbers make no sense.
    """
    if not 1 <= arguments.trials <= MOST_TRIALS or arguments.seed < 0:
        raise UserError(f"--trials must lie between 1 and {MOST_TRIALS}, and --seed be at least 0")
    run, policy = open_run(arguments.run)
    calm = calm_policy(arguments.run)
    if calm is not None:
        print("the learned policy:")
    show(run, policy, arguments.trials, arguments.seed)
    if calm is not None:
        print("\nthe calm policy, simplified from it:")
        show(run, calm, arguments.trials, arguments.seed)
    return 0


def show(run: Run, policy: Policy, count: int, seed: int) -> None:
    """Trials of a policy, their success rate, and how it moves without noise.

    Args:
      run: that the policy is of.
      policy: what is tried.
      count: trials.
      seed: of the actuators' noise.
    """
    tried = try_policy(run, policy, count, np.random.default_rng(seed))
    for trial, why in enumerate(run.spec.explain(tried.signals, tried.lengths)):
        judged = "".join(f"; {name}: {'yes' if values[trial] else 'no'}" for name, values in tried.outcomes.items())
        print(f"trial {trial}: robustness {why.value:+.4f}, {why.verdict}; decided {why.decided_by}{judged}")
    for name, successes in {"success": tried.robustness > 0, **tried.outcomes}.items():
        good = int(np.sum(successes))
        interval = binomtest(good, count).proportion_ci(method="wilson")
        print(
            f"{name} rate {good}/{count} = {good / count:.2f} "
            f"(95 % Wilson interval {interval.low:.2f} to {interval.high:.2f})"
        )
    task = make_task(run.task)
    simulator = Simulator(task)
    found = measures(task, run.spec, mean_motion(simulator, policy), simulator.command_range)
    print("the noise-free motion of the mean policy:")
    for name, value in found.items():
        if value is not None:
            print(f"  {name:<20} {value:8.3f}  {MEASURES[name]}")
