"""`tltl render RUN`: a picture of the workspace with the learned paths, if the task has one, and a video."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from tltlrl.errors import shown
from tltlrl.experiments.experiment import open_calm, open_run
from tltlrl.reports.strips import draw_strips
from tltlrl.reports.video import render_motion
from tltlrl.reports.workspace import can_draw, draw_workspace
from tltlrl.resources import user_path
from tltlrl.store.layout import CALM_WORKSPACE, WORKSPACE


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl render`."""
    parser.add_argument("run", type=user_path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    parser.add_argument("--output", type=user_path, help="a folder for them (default RUN)")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is no finished run, or nothing can be rendered on this machine.
    """
    asked, learned = open_run(arguments.run)
    folder = arguments.output or arguments.run
    folder.mkdir(parents=True, exist_ok=True)
    for policy, workspace, strips, motion in (
        (learned, WORKSPACE, "over_time", "motion"),
        (open_calm(asked, arguments.run), CALM_WORKSPACE, "over_time_calm", "motion_calm"),
    ):
        if policy is None:
            continue
        of = "" if policy is learned else " of the calm policy"
        if can_draw(asked):
            draw_workspace(asked, policy, folder / workspace)
            print(shown(f"{folder}/{workspace}.png, .pdf: the paths{of}"))
        draw_strips(asked, policy, folder / strips)
        print(shown(f"{folder}/{strips}.png, .pdf: path, commands and clauses{of} over time"))
        render_motion(asked, policy, folder / motion)
        print(shown(f"{folder}/{motion}.gif: the motion{of}; {motion}.png: frames of it"))
    return 0
