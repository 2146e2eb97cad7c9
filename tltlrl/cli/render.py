"""`tltl render RUN ...`: the learned paths, the motion over time, and a film; of several runs one film."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from tltlrl.errors import shown
from tltlrl.experiments.results import open_calm, open_run
from tltlrl.reports.strips import draw_strips
from tltlrl.reports.video import Film, beside, film, write_film
from tltlrl.reports.workspace import can_draw, draw_workspace
from tltlrl.resources import user_path
from tltlrl.store.layout import CALM_WORKSPACE, WORKSPACE
from tltlrl.training.build import make_task
from tltlrl.training.start import first_policy


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl render`."""
    parser.add_argument(
        "runs", type=user_path, nargs="+", metavar="RUN",
        help="for instance runs/reach_avoid/tltl_episodic/seed_0; of several, one film side by side",
    )  # fmt: skip
    parser.add_argument("--before", action="store_true", help="one film, beside the motion that learning began with")
    parser.add_argument("--output", type=user_path, help="folder of the pictures and films (default the first RUN)")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is no finished run, or nothing can be rendered on this machine.
    """
    folder = arguments.output or arguments.runs[0]
    if len(arguments.runs) > 1 or arguments.before:
        films = side_by_side(arguments.runs, arguments.before)
        folder.mkdir(parents=True, exist_ok=True)
        _say(write_film(beside(films), folder / "motion_beside"), "the motions side by side")
        return 0
    asked, learned = open_run(arguments.runs[0])
    folder.mkdir(parents=True, exist_ok=True)
    for policy, workspace, strips, motion in (
        (learned, WORKSPACE, "over_time", "motion"),
        (open_calm(asked, arguments.runs[0]), CALM_WORKSPACE, "over_time_calm", "motion_calm"),
    ):
        if policy is None:
            continue
        of = "" if policy is learned else " of the calm policy"
        if can_draw(asked):
            draw_workspace(asked, policy, folder / workspace)
            print(shown(f"{folder}/{workspace}.png, .pdf: the paths{of}"))
        draw_strips(asked, policy, folder / strips)
        print(shown(f"{folder}/{strips}.png, .pdf: path, commands and clauses{of} over time"))
        name = f"{asked.case.name} seed {asked.seed}{', calm' if of else ''}"
        _say(write_film(film(asked, policy, name), folder / motion), f"the motion{of}, and frames of it")
    return 0


def side_by_side(runs: Sequence[Path], before: bool) -> list[Film]:
    """A film of each run, named by what differs between the runs.

    Args:
      runs: folders of the runs.
      before: whether a film of the first run's first policy comes first.
    """
    opened = [open_run(path) for path in runs]
    experiments = [path.resolve().parent.parent.name for path in runs]
    several = len(set(experiments)) > 1
    films = []
    if before:
        learned, _ = opened[0]
        films.append(film(learned, first_policy(make_task(learned.task), learned.algorithm), "before learning"))
    for (learned, policy), experiment in zip(opened, experiments, strict=True):
        name = f"{learned.case.name} seed {learned.seed}"
        films.append(film(learned, policy, f"{experiment}: {name}" if several else name))
    return films


def _say(files: Sequence[Path], what: str) -> None:
    print(shown(f"{', '.join(map(str, files))}: {what}"))
    if not any(path.suffix == ".mp4" for path in files):
        print("for an mp4, too: pip install 'tltlrl[video]'")
