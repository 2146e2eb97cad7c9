"""`tltl evaluate RUN`: trials of a learned policy, in the evaluation scene, and their success rate."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

import numpy as np
from scipy.stats import binomtest

from tltlrl.errors import UserError
from tltlrl.experiments.experiment import open_run
from tltlrl.resources import user_path
from tltlrl.training.study import MOST_TRIALS
from tltlrl.training.verdict import try_policy


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl evaluate`."""
    parser.add_argument("run", type=user_path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    parser.add_argument("--trials", type=int, default=10, help="how many (default 10, as in the case study)")
    parser.add_argument("--seed", type=int, default=0, help="of the actuators' noise (default 0)")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is no finished run, or the numbers make no sense.
    """
    if not 1 <= arguments.trials <= MOST_TRIALS or arguments.seed < 0:
        raise UserError(f"--trials must lie between 1 and {MOST_TRIALS}, and --seed be at least 0")
    learned, policy = open_run(arguments.run)
    tried = try_policy(learned, policy, arguments.trials, np.random.default_rng(arguments.seed))
    for trial, why in enumerate(learned.spec.explain(tried.signals, tried.lengths)):
        judged = "".join(f"; {name}: {'yes' if values[trial] else 'no'}" for name, values in tried.outcomes.items())
        print(f"trial {trial}: robustness {why.value:+.4f}, {why.verdict}; decided {why.decided_by}{judged}")
    for name, successes in {"success": tried.robustness > 0, **tried.outcomes}.items():
        count = int(np.sum(successes))
        interval = binomtest(count, arguments.trials).proportion_ci(method="wilson")
        print(
            f"{name} rate {count}/{arguments.trials} = {count / arguments.trials:.2f} "
            f"(95 % Wilson interval {interval.low:.2f} to {interval.high:.2f})"
        )
    return 0
