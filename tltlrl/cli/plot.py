"""`tltl plot EXPERIMENT ...`: the learning curves of one or more experiments, from their CSV files."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from tltlrl.reports.plotting import plot_learning_curves, read_curves
from tltlrl.store.layout import FIGURE


def add_parser(subparsers: Any, about: str) -> None:
    """Adds `plot` to a parser's sub-commands."""
    parser = subparsers.add_parser("plot", help=about, description=__doc__)
    parser.add_argument("experiments", type=Path, nargs="+", metavar="EXPERIMENT", help="for instance runs/reach_avoid")
    parser.add_argument("--output", type=Path, help="where to, without suffix (default EXPERIMENT/learning_curves)")
    parser.set_defaults(command=plot)


def plot(arguments: Namespace) -> int:
    """The sub-command; returns its exit code.

    Raises:
      UserError: if an experiment's CSV file cannot be read.
    """
    output = arguments.output or arguments.experiments[0] / FIGURE
    plot_learning_curves([read_curves(folder) for folder in arguments.experiments], output)
    print(f"{output}.png, {output}.pdf")
    return 0
