"""`tltl plot EXPERIMENT ...`: the learning curves of one or more experiments, from the CSV files of its runs."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from tltlrl.errors import shown
from tltlrl.reports.plotting import FORMATS, plot_learning_curves, stem, titled
from tltlrl.reports.sealed import read_curves, read_summary
from tltlrl.resources import user_path
from tltlrl.store.layout import CONFIG, FIGURE

NAMES = 3  # config keys in an experiment's name, at most


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl plot`."""
    parser.add_argument(
        "experiments", type=user_path, nargs="+", metavar="EXPERIMENT", help="for instance runs/reach_avoid"
    )
    parser.add_argument(
        "--output",
        type=user_path,
        help="path of the picture; always written as .png and .pdf (default EXPERIMENT/learning_curves)",
    )
    parser.add_argument(
        "--compare",
        action="store_true",
        help="compare experiments; of one task: for each case a line per experiment, and whether the first is better "
        "than each of the others (EXPERIMENT/comparison); of several tasks: each case over all of them",
    )


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if an experiment's CSV file cannot be read, or a picture of another kind is wanted.
    """
    if arguments.compare:
        return _compare(arguments)
    output = stem(arguments.output or arguments.experiments[0] / FIGURE)
    found = [read_curves(folder) for folder in arguments.experiments]
    for _, notes in found:
        for note in notes:
            print(shown(f"tltl: {note}"), file=sys.stderr)
    experiments = [curves for curves, _ in found]
    plot_learning_curves(titled(arguments.experiments, experiments), output)
    print(shown(", ".join(f"{output}{suffix}" for suffix in FORMATS)))
    return 0


def _compare(arguments: Namespace) -> int:
    from tltlrl.errors import UserError
    from tltlrl.reports.across import differences, never_satisfied, over_tasks, plot_cases

    folders: Sequence[Path] = arguments.experiments
    if len(folders) < 2:
        raise UserError("--compare: give two experiments or more, as in tltl plot runs/A runs/B --compare")
    output = stem(arguments.output or folders[0] / "comparison")
    names = names_of(folders)
    found = {name: read_summary(folder) for name, folder in zip(names, folders, strict=True)}
    for note in dict.fromkeys(note for _, notes in found.values() for note in notes):
        print(shown(f"tltl: {note}"), file=sys.stderr)
    summaries = {name: summary for name, (summary, _) in found.items()}
    aggregates = over_tasks(list(summaries.values()))
    said = [*map(str, differences(summaries)), *map(str, aggregates)]
    if aggregates and (tasks := never_satisfied(list(summaries.values()))):
        said.append(f"robustness is not taken together: no run satisfies the spec of {', '.join(tasks)}")
    if not said:
        raise UserError(
            "--compare: the experiments have no case with common seeds, and none with two seeds or more in every task"
        )
    if len({summary["task"].iloc[0] for summary in summaries.values()}) == 1:
        plot_cases({name: read_curves(folder)[0] for name, folder in zip(names, folders, strict=True)}, output)
        print(shown(", ".join(f"{output}{suffix}" for suffix in FORMATS)))
    print("\n".join(map(shown, said)))
    return 0


def names_of(folders: Sequence[Path]) -> list[str]:
    """A name for each experiment: the config values that differ, or its folder's name if those are not enough."""
    import yaml

    from tltlrl.config.compare import flatten
    from tltlrl.config.keys import having
    from tltlrl.settings import Role
    from tltlrl.store.bounded import read_yaml

    try:
        configs = [flatten(read_yaml(folder / CONFIG)) for folder in folders]
    except (OSError, ValueError, AttributeError, yaml.YAMLError):
        return [str(folder) for folder in folders]
    untold = having(Role.NAMES | Role.GROWS | Role.BUDGET)
    keys = [
        key
        for key in dict.fromkeys(key for config in configs for key in config)
        if key not in untold and len({str(config.get(key)) for config in configs}) > 1
    ]
    names = [", ".join(f"{key}={config.get(key)}" for key in keys[:NAMES]) for config in configs]
    if len(set(names)) == len(names) and len(keys) <= NAMES:
        return names
    short = [folder.resolve().name for folder in folders]
    return short if len(set(short)) == len(short) else [str(folder) for folder in folders]
