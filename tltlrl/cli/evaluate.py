"""`tltl evaluate RUN`: trials of a learned policy in the evaluation scene, their success rate, and how it moves."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from tltlrl.errors import UserError
from tltlrl.experiments.experiment import open_calm, open_run
from tltlrl.learning.policy import Policy
from tltlrl.simulation.motion import MEASURES, measure
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.training.build import make_task
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
    calm = open_calm(arguments.run)
    if calm is not None:
        print("the learned policy")
    _tell(run, policy, arguments)
    if calm is not None:
        print("\nthe calm policy")
        _tell(run, calm, arguments)
    return 0


def _tell(run: Run, policy: Policy, arguments: Namespace) -> None:
    tried = try_policy(run, policy, arguments.trials, np.random.default_rng(arguments.seed))
    for trial, why in enumerate(run.spec.explain(tried.signals, tried.lengths)):
        judged = "".join(f"; {name}: {'yes' if values[trial] else 'no'}" for name, values in tried.outcomes.items())
        print(f"trial {trial}: robustness {why.value:+.4f}, {why.verdict}; decided {why.decided_by}{judged}")
    for name, successes in {"success": tried.robustness > 0, **tried.outcomes}.items():
        count = int(np.sum(successes))
        interval = binomtest(count, arguments.trials).proportion_ci(method="wilson")
        print(
            f"{name} rate {count}/{arguments.trials} = {count / arguments.trials:.2f} "
            f"(95 % Wilson interval {interval.low:.2f} to {interval.high:.2f})"
        )
    task = make_task(run.task)
    simulator = Simulator(task)
    for name, value in measure(task, simulator, run.spec, mean_motion(simulator, policy)).items():
        meaning, unit = MEASURES[name]
        print(f"{meaning}: {'none' if value is None else f'{value:.3g} {unit}'.rstrip()}")
