"""`tltl tasks [NAME|FILE]`: the tasks; of one task or robot's page, its signals and the values that they take."""

from __future__ import annotations

import dataclasses
from argparse import ArgumentParser, Namespace
from pathlib import Path

import numpy as np

from tltlrl.errors import UserError


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl tasks`."""
    parser.add_argument("task", metavar="NAME|FILE", nargs="?", help="a task by its name, or the page of a robot")
    parser.add_argument("id", metavar="ID", nargs="?", help="the environment, where the task is gymnasium or suite")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the scene at the start, with its axes")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is no such task, or something is wrong with a page.
    """
    if arguments.picture is not None and (arguments.task is None or arguments.picture.suffix != ".png"):
        raise UserError(
            "--picture FILE.png: it shows the scene of one task; give its name, and a file that ends in .png"
        )
    if arguments.task is None:
        print(_all())
        return 0
    from tltlrl.registry import OUTSIDE, TASKS
    from tltlrl.resources import is_page
    from tltlrl.simulation.probe import ranges_seen

    if is_page(arguments.task):
        from tltlrl.tasks.mjcf.file import config_of, path_of

        config = config_of(path_of(arguments.task))
    else:
        config = TASKS.get(arguments.task).config()
        if arguments.id is not None:
            if arguments.task not in OUTSIDE:
                raise UserError(
                    f"{arguments.id}: only {' and '.join(OUTSIDE)} have environments by their id; leave it out"
                )
            config = dataclasses.replace(config, id=arguments.id)
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
    if arguments.picture is not None:
        from tltlrl.reports.video import render_start

        render_start(task, arguments.picture)
        axes = ", the x axis red, y green, z blue" if task.outside is None else ""
        print(f"{arguments.picture}: the scene at the start{axes}")
    return 0


def _all() -> str:
    from tltlrl.registry import TASKS

    lines = []
    for name in TASKS.names():
        entry = TASKS.get(name)
        rewards = ", ".join(entry.hand_made) or "none"
        lines.append(f"{name:<16} spec {entry.spec or 'none'}; hand-made rewards: {rewards}")
    lines.append(f"{'gymnasium ID':<16} an environment of Gymnasium; hand-made rewards: environment")
    lines.append(f"{'suite ID':<16} an environment of dm_control's suite; hand-made rewards: environment")
    lines.append(f"{'FILE.yaml':<16} a robot of your own; tltl new MODEL.xml makes one")
    return "\n".join(lines)
