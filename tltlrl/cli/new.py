"""`tltl new MODEL.xml`: a page and a spec for a robot of your own; with --task a spec for a task that exists.

tltl new arm.xml                            looks at a model; writes arm.yaml and arm.tltl into this folder
tltl new --task reach_avoid mine.tltl       writes a spec to begin with
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from tltlrl.errors import UserError

GENTLY = (
    "algorithm.initial_std=0.3 algorithm.correlation=10"  # full commands that change at every step throw an arm about
)
CALM = " algorithm.calm=50"


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl new`."""
    parser.add_argument("file", metavar="FILE", help="an MJCF file; with --task the .tltl file to be written")
    parser.add_argument("--task", metavar="NAME", help="a task by its name; tltl tasks lists them")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: if there is no such model or task, or a file is there already.
    """
    if arguments.task is not None:
        return _spec_for(arguments.task, Path(arguments.file))
    from tltlrl.simulation.draft import draft  # with MuJoCo

    page, spec = (Path(Path(arguments.file).name).with_suffix(suffix) for suffix in (".yaml", ".tltl"))
    _refuse(page, spec)
    found = draft(arguments.file, page)
    _write(page, found.page)
    _write(spec, found.spec)
    print(f"{page}: the robot; {spec}: what it is to do. Look at both, then")
    print(f"  tltl-run task={page} seeds=1 algorithm.iterations=40 {GENTLY}{CALM * found.at_speeds}")
    print(f"It draws its curves into runs/; tltl tasks {page} lists what a spec can speak of.")
    return 0


def _spec_for(task: str, path: Path) -> int:
    from tltlrl.registry import TASKS
    from tltlrl.resources import spec_path

    entry = TASKS.get(task)
    if entry.spec is None:
        raise UserError(f"--task {task}: no spec comes with it; tltl tasks {task} says what a spec can speak of")
    if path.suffix != ".tltl":
        raise UserError(f"{path}: the file of a spec ends in .tltl")
    _refuse(path)
    _write(path, spec_path(entry.spec).read_text(encoding="utf-8"))
    print(f"{path}: the spec of {task}, to be changed; then")
    print(f"  tltl-run task={task} spec={path} name={path.stem} seeds=1 algorithm.iterations=40")
    return 0


def _refuse(*paths: Path) -> None:
    for path in paths:
        if path.exists():
            raise UserError(f"{path} is there already; delete it, or work in another folder")


def _write(path: Path, text: str) -> None:
    with open(path, "x", encoding="utf-8") as file:
        file.write(text)
