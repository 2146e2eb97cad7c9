"""A command of tltlrl as a process of its own, without the seconds in which a new interpreter imports everything.

What starts workers cannot be run like this: multiprocessing would import the tests' own program in them.
"""

import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import tltlrl.experiments.experiment  # noqa: F401  # so that the forked processes have it
from tltlrl.cli import main as cli


def tltl_run(folder: Path, *arguments: str, first: Callable[[], object] = lambda: None) -> tuple[int, str, str]:
    """`tltl-run ARGUMENTS` in a folder, after `first()`: exit code (-N if signal N ended it), output, errors."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if pid == 0:
            code = 3
            try:
                os.chdir(folder)
                os.dup2(output.fileno(), 1)
                os.dup2(errors.fileno(), 2)
                sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
                sys.argv = ["tltl-run", *arguments]
                first()
                code = cli.run(list(arguments))
            except SystemExit as exit_:
                code = 0 if exit_.code is None else int(exit_.code)
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        return code, *(file.seek(0) or file.read() for file in (output, errors))
