"""A command of tltlrl as a process of its own, without the seconds in which a new interpreter imports everything.

What starts workers cannot be run like this: multiprocessing would import the tests' own program in them.
"""

import contextlib
import functools
import importlib
import io
import os
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from unittest import mock

from sketched.sketch import sketch

import tltlrl.experiments.experiment  # so that the forked processes have it
import tltlrl.reports.plotting
from tltlrl.cli import main as cli

PICTURES = (
    "tltlrl.reports.report.plot_learning_curves",
    "tltlrl.reports.report.plot_clauses",
    "tltlrl.experiments.experiment.draw_workspace",
    "tltlrl.experiments.experiment.write_page",
)


def without_pictures() -> None:
    """From now on this process draws none: they take most of the time of a small experiment."""
    for place in PICTURES:
        module, _, name = place.rpartition(".")
        setattr(importlib.import_module(module), name, lambda *_, **__: None)


def with_sketches() -> None:
    """From now on this process's pictures are sketches."""
    tltlrl.reports.plotting.picture = sketch


def sketched() -> dict[str, str]:
    """The environment in which the pictures of processes are sketches."""
    own = str(Path(__file__).with_name("sketched"))
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, (own, os.environ.get("PYTHONPATH"))))}


def tltl_run(folder: Path, *arguments: object, first: Callable[[], object] = lambda: None) -> tuple[int, str, str]:
    """`tltl-run ARGUMENTS` in a folder, after `first()`: exit code (-N if signal N ended it), output, errors."""
    return run("tltl-run", cli.run, folder, list(map(str, arguments)), first)


def tltl(folder: Path, *arguments: object, first: Callable[[], object] = lambda: None) -> tuple[int, str, str]:
    """`tltl ARGUMENTS`, in the same way."""
    return run("tltl", cli.main, folder, list(map(str, arguments)), first)


def run(
    name: str,
    command: Callable[[list[str]], int | None],
    folder: Path,
    arguments: Sequence[str] = (),
    first: Callable[[], object] = lambda: None,
) -> tuple[int, str, str]:
    """A function as the command `name` with these arguments."""
    _ready()
    ours, its = zip(os.pipe(), os.pipe(), strict=True)  # and not files, whose size a test may limit
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if pid == 0:
        code: int | None = 3
        try:
            os.chdir(folder)
            for descriptor, end in enumerate(its, start=1):
                os.dup2(end, descriptor)
            sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
            sys.argv = [name, *arguments]
            first()
            code = command(list(arguments))
            sys.stdout.flush()
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 0
            sys.stdout.flush()
        finally:
            os._exit(code or 0)
    for end in its:
        os.close(end)
    with ThreadPoolExecutor(2) as readers:
        output, errors = readers.map(_read, ours)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), output, errors


@functools.cache
def _ready() -> None:
    """What a process imports, composes and looks up once, done here for all that are forked: half a second each."""
    small = ("cases=[tltl_episodic]", "seeds=1", "trials=1", "algorithm.iterations=1", "task.steps=12", "workers=1")
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.redirect_stderr(io.StringIO()) as said,
        mock.patch.object(tltlrl.reports.plotting, "picture", sketch),
    ):
        code = cli.run(["experiment=reach_avoid", *small, f"runs_dir={folder}"])
    assert code == 0, said.getvalue()


def _read(descriptor: int) -> str:
    with os.fdopen(descriptor) as file:
        return file.read()
