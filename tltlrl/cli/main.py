"""The commands `tltl-run` and `tltl`: finds and imports the chosen command, and prints users' mistakes.

Each command is a module beside this one. It is imported only when chosen, so that Ctrl-C is answered from the start.
"""

from __future__ import annotations

import argparse
import atexit
import contextlib
import gc
import importlib
import os
import sys
import warnings
from collections.abc import Callable

from tltlrl.errors import UserError, shown

# kB of address space (`ulimit -v`) without which BLAS, as it is loaded, asks for memory for ever or ends the process.
NEEDED, NEEDED_FOR_A_SPEC = 1_000_000, 250_000
SELDOM = 100_000  # new objects between two garbage collections: those of imported modules are no garbage
OF_A_SPEC_ALONE = ("check", "watch")

COMMANDS = {
    "check": "check a spec and, with a trace, print robustness, verdict and explanation",
    "watch": "follow a trajectory while it runs: samples on standard input, robustness and bounds at once",
    "new": "a page and a spec for a robot of your own, from its MJCF file",
    "tasks": "the tasks; of one task, its signals and the values that they take",
    "evaluate": "trials of a learned policy and their success rate",
    "render": "pictures of the learned paths and of the motion over time, and a film",
    "plot": "the learning curves of one or more experiments, from their CSV files",
    "export": "the curves and clauses of an experiment for TensorBoard, also while it runs",
    "search": "the best values of a few keys of an experiment, by Optuna",
}


def run_main() -> None:
    """The command `tltl-run`."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Runs `tltl-run ARGUMENTS` and returns its exit code."""

    def command() -> int:
        _check_memory("tltl-run", NEEDED)
        _render_nothing()

        from tltlrl.cli.run import tltl_run

        # With -m, Ctrl-C ends all experiments, so it is reported only once.
        return tltl_run(arguments, lambda start: mistakes_told("tltl-run", start))

    return _told("tltl-run", arguments, command)


def main(arguments: list[str] | None = None) -> None:
    """The command `tltl`."""
    given = sys.argv[1:] if arguments is None else arguments
    sys.exit(_told("tltl", given, lambda: _tltl(given)))


def _tltl(arguments: list[str]) -> int:
    if arguments and arguments[0] in COMMANDS:
        alone = arguments[0] in OF_A_SPEC_ALONE and not any(argument.startswith("--plot") for argument in arguments)
        _check_memory(f"tltl {arguments[0]}", NEEDED_FOR_A_SPEC if alone else NEEDED)
        if arguments[0] != "render" and not any(argument.startswith("--picture") for argument in arguments):
            _render_nothing()
        module = importlib.import_module(f"tltlrl.cli.{arguments[0]}")
        parser = argparse.ArgumentParser(
            f"tltl {arguments[0]}",
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        module.add_arguments(parser)
        return int(module.run(parser.parse_intermixed_args(arguments[1:])))  # options stand anywhere
    parser = argparse.ArgumentParser("tltl", description="Check specs; evaluate, render and plot what was learned.")
    parser.add_argument("--version", action="store_true", help="print the version of tltlrl")
    commands = parser.add_subparsers(metavar="COMMAND")
    for name, about in COMMANDS.items():
        commands.add_parser(name, help=about)
    if parser.parse_args(arguments).version:
        from tltlrl import __version__

        print(f"tltlrl {__version__}")
        return 0
    raise UserError(f"say which command, one of: {', '.join(COMMANDS)}")


def _check_memory(name: str, needed: int) -> None:
    """Checks the limit of memory, before BLAS is loaded. Under a limit BLAS starts no threads, which take 40 MB each.

    Raises:
      UserError: if the limit is below what is needed, in kB.
    """
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(threads, "1")
    if limit < needed * 1024:
        raise UserError(
            f"there is not enough memory: {name} needs {needed} kB of address space or more, and ulimit -v is "
            f"{limit // 1024}; raise it"
        )


def _render_nothing() -> None:
    """Turns rendering off for commands that render nothing: to look for a renderer takes a second."""
    os.environ["MUJOCO_GL"] = "disable"


def _told(name: str, arguments: list[str], command: Callable[[], int]) -> int:
    """Runs a command. A user's mistake becomes one message and exit code 2; Ctrl-C one message and 130."""
    _standard_streams()
    gc.set_threshold(SELDOM)
    atexit.register(gc.freeze)  # nor are they worth a search when the interpreter ends
    usual = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: f"{name}: {shown(str(message))}\n"  # without a line of our code
    try:
        return mistakes_told(name, command)
    except KeyboardInterrupt:
        without = " without overwrite=true" if "overwrite=true" in arguments else ""
        _say(f"{name}: stopped; the same command{without} continues from what is done")
        return 130
    finally:
        warnings.formatwarning = usual


def mistakes_told(name: str, command: Callable[[], int]) -> int:
    """Runs a command. A user's mistake becomes one message and exit code 2."""
    try:
        code = command()
        sys.stdout.flush()  # so that errors of writing are raised here, not when the interpreter ends
        return code
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (UserError, FloatingPointError) as error:  # the latter: a simulation that diverged
        _say(f"{name}: {error}")
    except RecursionError:
        _say(f"{name}: a given file or value is nested too deeply")
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        _say(
            f"{name}: {where}{error.strerror or error}; check the disk or the folder, then start the command again: "
            "what is done is kept"
        )
    except Exception as error:
        if not _for_want_of_memory(error):
            raise
        _say(f"{name}: there is not enough memory{f' ({error})' if str(error) else ''}; what is done is kept")
    return 2


def _for_want_of_memory(error: Exception) -> bool:
    """Whether memory ran out; libraries that cannot be loaded, and MuJoCo, have their own words for it."""
    words = ("allocate memory", "failed to map segment", "unable to allocate", "out of memory", "bad_alloc")
    return isinstance(error, MemoryError) or any(part in str(error).lower() for part in words)


def _say(line: str) -> None:
    """Prints a message; if standard error cannot be written to, only the exit code is left."""
    with contextlib.suppress(OSError):
        print(shown(line), file=sys.stderr)


def _standard_streams() -> None:
    """Opens closed standard streams to nowhere: otherwise output would go into the next file that is opened."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number, which is this one
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, "w" if number else "r", closefd=False))  # noqa: SIM115
