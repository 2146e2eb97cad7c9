"""`tltl render RUN`: a picture of the workspace with the learned paths, if the task has one, and a video."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from tltlrl.experiments.experiment import open_run
from tltlrl.reports.video import render_motion
from tltlrl.reports.workspace import draw_workspace
from tltlrl.store.layout import WORKSPACE
from tltlrl.training.build import make_task
from tltlrl.training.session import calm_policy


def add_parser(subparsers: Any, about: str) -> None:
    """Adds `render` to a parser's sub-commands."""
    parser = subparsers.add_parser("render", help=about, description=__doc__)
    parser.add_argument("run", type=Path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    parser.add_argument("--output", type=Path, help="a folder for them (default RUN)")
    parser.set_defaults(command=render)


def render(arguments: Namespace) -> int:
    """The sub-command; returns its exit code.

    Raises:
      UserError: if there is no finished run, or nothing can be rendered on this machine.
    """
    run, policy = open_run(arguments.run)
    folder = arguments.output or arguments.run
    folder.mkdir(parents=True, exist_ok=True)
    calm = calm_policy(arguments.run)
    for motion, suffix, what in ((policy, "", ""), (calm, "_calm", ", made calm")):
        if motion is None:
            continue
        if make_task(run.task).skeleton is not None:
            draw_workspace(run, motion, folder / f"{WORKSPACE}{suffix}")
            print(f"{folder}/{WORKSPACE}{suffix}.png, .pdf: the paths{what}")
        render_motion(run, motion, folder / f"motion{suffix}")
        print(f"{folder}/motion{suffix}.gif: the motion{what}; motion{suffix}.png: frames of it")
    return 0
