"""`tltl evaluate RUN`: trials of a learned policy, in the evaluation scene, and their success rate.

With --trace motion.csv the learned motion, without any noise, is written as a trace. With --samples 3, three sampled
motions are written, too, as motion_1.csv and so on. `tltl check SPEC motion.csv --plot motion.png` explains them.
--perturb adds trials off the model: a table of success against the size of the perturbation.
"""

from __future__ import annotations

import json
import shlex
from argparse import ArgumentParser, Namespace
from pathlib import Path

import numpy as np

from tltlrl.errors import UserError, shown
from tltlrl.experiments.results import open_calm, open_run
from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec, load_spec
from tltlrl.logic.reasons import failed
from tltlrl.logic.trace import write_recording
from tltlrl.reports.interval import share_interval
from tltlrl.resources import user_path
from tltlrl.simulation.motion import MEASURES, measures
from tltlrl.simulation.perturb import Perturbation, perturbation_of
from tltlrl.simulation.simulator import simulator_of
from tltlrl.simulation.trials import mean_motion
from tltlrl.training.build import make_task
from tltlrl.training.study import MOST_TRIALS, Run
from tltlrl.training.verdict import Motions, motions, try_off_model, try_policy

SIZES = (0.0, 0.25, 0.5, 0.75, 1.0)  # of a perturbation


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl evaluate`."""
    parser.add_argument("run", type=user_path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    parser.add_argument("--trials", type=int, default=10, help="number of trials (default 10, as in the case study)")
    parser.add_argument(
        "--trace",
        type=user_path,
        metavar="FILE.csv",
        help="write the learned motion as a trace, a calm one beside it as FILE_calm.csv",
    )
    parser.add_argument("--samples", type=int, default=0, help="write this many sampled motions, too (default 0)")
    parser.add_argument(
        "--perturb",
        metavar="mass=0.8:1.2,friction=0.5:1.5,start=0.02",
        help="more trials off the model: a table of success against the size of the perturbation; takes damping, too",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the actuators' noise (default 0)")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is no finished run, or the numbers make no sense.
    """
    if arguments.samples and arguments.trace is None:
        raise UserError("--samples: say where to write them, as in --trace motion.csv")
    if not 0 <= arguments.samples <= MOST_TRIALS:
        raise UserError(f"--samples must lie between 0 and {MOST_TRIALS}")
    if not 1 <= arguments.trials <= MOST_TRIALS or arguments.seed < 0:
        raise UserError(f"--trials must lie between 1 and {MOST_TRIALS}, and --seed be at least 0")
    perturbation = None if arguments.perturb is None else perturbation_of(arguments.perturb)
    learned, policy = open_run(arguments.run)
    if perturbation is not None and (task := make_task(learned.task)).outside is not None:
        raise UserError(
            f"--perturb: {task.name} is an environment of others, whose model is not ours to change; leave it out"
        )
    calm = open_calm(learned, arguments.run)
    if calm is not None:
        print("the learned policy")
    _tell(learned, policy, arguments)
    if calm is not None:
        print("\nthe calm policy")
        _tell(learned, calm, arguments)
    if arguments.trace is not None:
        rng = np.random.default_rng(arguments.seed)
        write_traces(arguments.trace, learned, motions(learned, policy, arguments.samples, rng), "learned")
        print(shown(f"explained by: {check_command(learned.spec, arguments.trace)}"))
        if calm is not None:
            path = arguments.trace.with_stem(f"{arguments.trace.stem}_calm")
            write_traces(path, learned, motions(learned, calm, 0, rng), "calm")
            print(shown(f"explained by: {check_command(learned.spec, path)}"))
    return 0


def _tell(learned: Run, policy: Policy, arguments: Namespace) -> None:
    """Prints the trials of one policy and the measures of its motion."""
    tried = try_policy(learned, policy, arguments.trials, np.random.default_rng(arguments.seed))
    explained = learned.spec.explain(tried.signals, tried.lengths)
    for trial, why in enumerate(explained):
        judged = "".join(f"; {name}: {'yes' if values[trial] else 'no'}" for name, values in tried.outcomes.items())
        print(f"trial {trial}: robustness {why.value:+.4f}, {why.verdict}; decided {why.decided_by}{judged}")
    for name, successes in {"success": tried.robustness > 0, **tried.outcomes}.items():
        count = int(np.sum(successes))
        low, high = share_interval(count, arguments.trials)
        print(
            f"{name} rate {count}/{arguments.trials} = {count / arguments.trials:.2f} "
            f"(95 % Wilson interval {low:.2f} to {high:.2f})"
        )
    task = make_task(learned.task)
    low, middle, high = np.quantile(tried.robustness, [0.05, 0.5, 0.95], method="lower")
    print(f"robustness: 5 % of the trials up to {low:+.4f}, half up to {middle:+.4f}, 95 % up to {high:+.4f}")
    for reason in failed(explained):
        print(f"{reason.count} fail by {reason.told(task.control_timestep)}")
    simulator = simulator_of(task)
    found = measures(task, learned.spec, mean_motion(simulator, policy), simulator.command_range)
    print("the noise-free motion of the mean policy:")
    for name, value in found.items():
        if value is not None:
            print(f"  {name:<20} {value:8.3f}  {MEASURES[name]}")
    if arguments.perturb is not None:
        _tell_off_model(learned, policy, perturbation_of(arguments.perturb), arguments)


def _tell_off_model(learned: Run, policy: Policy, perturbation: Perturbation, arguments: Namespace) -> None:
    """Prints a table of trials against the size of the perturbation."""
    print("off the model, each trial with factors and a start of its own; size 1 is the whole of --perturb:")
    print("  size  success    95 % Wilson    robustness: 5 %   median  what decides most failures")
    for size in SIZES:
        rng = np.random.default_rng(arguments.seed)
        tried, diverged = try_off_model(learned, policy, perturbation, size, arguments.trials, rng)
        robustness, reasons = np.full(diverged, -np.inf), [(diverged, "the simulation diverged")] if diverged else []
        if tried is not None:
            robustness = np.concatenate([robustness, tried.robustness])
            told = failed(learned.spec.explain(tried.signals, tried.lengths))
            reasons += [(reason.count, reason.what) for reason in told]
        count = int(np.sum(robustness > 0))
        least, most = share_interval(count, arguments.trials)
        low, median = np.quantile(robustness, [0.05, 0.5], method="lower")
        most_often = max(reasons, key=lambda reason: reason[0], default=None)
        why = f"{most_often[1]} ({most_often[0]})" if most_often else ""
        print(
            f"  {size:4.2f}  {f'{count}/{arguments.trials}':<9}  {least:.2f} to {most:.2f}"
            f"  {low:+15.4f}  {median:+7.4f}  {why}".rstrip()
        )


def write_traces(path: Path, run: Run, moved: Motions, name: str) -> None:
    """Writes the mean motion of a policy to `path`, sampled ones beside it, and prints their robustness.

    Args:
      path: of a CSV file.
      run: what was learned.
      moved: the mean motion, then sampled ones.
      name: of the policy.

    Raises:
      UserError: if a file cannot be written.
    """
    period = make_task(run.task).control_timestep
    for i, (length, robustness) in enumerate(zip(moved.lengths, moved.robustness, strict=True)):
        own = path if i == 0 else path.with_name(f"{path.stem}_{i}{path.suffix}")
        write_recording(own, {name: values[i, :length] for name, values in moved.signals.items()}, period)
        print(shown(f"{own}: {f'the {name}' if i == 0 else 'a sampled'} motion, robustness {robustness:+.6g}"))


def check_command(spec: Spec, trace: Path) -> str:
    """The command that explains a trace by the spec with the constants that it was learned with."""
    assert spec.path is not None
    settings = []
    for name, value in spec.constants.items():
        if value != load_spec(spec.path).constants[name]:
            family = {f"{name}.{label}": v for label, v in value.items()} if isinstance(value, dict) else {name: value}
            settings += [text for key, v in family.items() for text in ("--set", f"{key}={json.dumps(v)}")]
    return shlex.join(["tltl", "check", str(spec.path), str(trace), *settings])
