"""`tltl tasks [NAME|FILE]`: the tasks; of one, or of a robot's page, its signals, with what values they take."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np


def add_parser(subparsers: Any, about: str) -> None:
    """Adds `tasks` to a parser's sub-commands."""
    parser = subparsers.add_parser("tasks", help=about, description=__doc__)
    parser.add_argument("task", metavar="NAME|FILE", nargs="?", help="a task by its name, or the page of a robot")
    parser.set_defaults(command=tasks)


def tasks(arguments: Namespace) -> int:
    """The sub-command; returns its exit code.

    Raises:
      UserError: if there is no such task, or something is wrong with a page.
    """
    if arguments.task is None:
        print(_all())
        return 0
    from tltlrl.config.compose import is_page
    from tltlrl.registry import TASKS
    from tltlrl.simulation.probe import ranges_seen

    if is_page(arguments.task):
        from tltlrl.config.robot import config_of, path_of

        config = config_of(path_of(arguments.task))
    else:
        config = TASKS.get(arguments.task).config()
    task = TASKS.get(config.name).make(config)
    seconds = task.steps * task.control_timestep
    print(f"{task.name}: {task.steps} samples, one every {task.control_timestep:g} s, {seconds:g} s in all")
    print(f"commands: {', '.join(part for group in task.action for part in group.parts)}")
    print("signals, with the least and the most of each component under random commands of full size:")
    for name, (low, high) in ranges_seen(task, np.random.default_rng(0)).items():
        size = "" if len(low) == 1 else f"[{len(low)}]"
        unit = task.units.get(name, "")
        spans = ", ".join(f"{least:.3g} to {most:.3g}" for least, most in zip(low, high, strict=True))
        print(f"  {name + size:<16} {unit:<14} {spans}")
    return 0


def _all() -> str:
    from tltlrl.registry import TASKS

    lines = []
    for name in TASKS.names():
        entry = TASKS.get(name)
        rewards = ", ".join(entry.hand_made) or "none"
        lines.append(f"{name:<16} spec {entry.spec or 'none'}; hand-made rewards: {rewards}")
    lines.append(f"{'FILE.yaml':<16} a robot of your own; tltl new MODEL.xml makes one")
    return "\n".join(lines)
