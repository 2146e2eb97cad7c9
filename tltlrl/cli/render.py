"""`tltl render RUN`: a picture of the workspace with the learned paths, if the task has one, and a video."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

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
    learned, policy = open_run(arguments.run)
    folder = arguments.output or arguments.run
    folder.mkdir(parents=True, exist_ok=True)
    calm = open_calm(arguments.run)
    for shown, workspace, strips, motion in (
        (policy, WORKSPACE, "over_time", "motion"),
        (calm, CALM_WORKSPACE, "over_time_calm", "motion_calm"),
    ):
        if shown is None:
            continue
        of = " of the calm policy" if shown is calm else ""
        if can_draw(learned):
            draw_workspace(learned, shown, folder / workspace)
            print(f"{folder}/{workspace}.png, .pdf: the paths{of}")
        draw_strips(learned, shown, folder / strips)
        print(f"{folder}/{strips}.png, .pdf: path, commands and clauses{of} over time")
        render_motion(learned, shown, folder / motion)
        print(f"{folder}/{motion}.gif: the motion{of}; {motion}.png: frames of it")
    return 0
