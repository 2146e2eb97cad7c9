"""`tltl export EXPERIMENT --to tensorboard`: the curves and clauses of its runs for TensorBoard."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from tltlrl.errors import shown
from tltlrl.reports.tensorboard import export
from tltlrl.resources import user_path


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl export`."""
    parser.add_argument("experiment", type=user_path, metavar="EXPERIMENT", help="for instance runs/reach_avoid")
    parser.add_argument("--to", choices=["tensorboard"], required=True, help="the format")
    parser.add_argument("--output", type=user_path, help="a new or empty folder (default tensorboard/NAME)")
    parser.add_argument("--follow", action="store_true", help="go on until every run has ended")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is nothing to export, or no package to do it with.
    """
    output = arguments.output or Path("tensorboard") / arguments.experiment.resolve().name
    written = export(arguments.experiment, output, arguments.follow)
    print(shown(f"{output}: {len(written)} runs, {sum(written.values())} iterations; tensorboard --logdir {output}"))
    return 0
