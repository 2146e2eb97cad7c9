"""`tltl plot EXPERIMENT ...`: the learning curves of one or more experiments, from the CSV files of its runs."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace

from tltlrl.errors import shown
from tltlrl.reports.plotting import FORMATS, plot_learning_curves, stem, titled
from tltlrl.reports.sealed import read_curves
from tltlrl.resources import user_path
from tltlrl.store.layout import FIGURE


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl plot`."""
    parser.add_argument(
        "experiments", type=user_path, nargs="+", metavar="EXPERIMENT", help="for instance runs/reach_avoid"
    )
    parser.add_argument(
        "--output", type=user_path, help="where to; as .png and .pdf in any case (default EXPERIMENT/learning_curves)"
    )


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if an experiment's CSV file cannot be read, or a picture of another kind is wanted.
    """
    output = stem(arguments.output or arguments.experiments[0] / FIGURE)
    found = [read_curves(folder) for folder in arguments.experiments]
    for _, notes in found:
        for note in notes:
            print(shown(f"tltl: {note}"), file=sys.stderr)
    experiments = [curves for curves, _ in found]
    plot_learning_curves(titled(arguments.experiments, experiments), output)
    print(shown(", ".join(f"{output}{suffix}" for suffix in FORMATS)))
    return 0
