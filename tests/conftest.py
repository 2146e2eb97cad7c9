"""Shared by all tests: the command, run as users run it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture
def tltl_run(tmp_path):
    """Runs `tltl-run ARGUMENTS runs_dir=<tmp>/runs` in an empty folder: (exit code, stdout, stderr)."""
    return command(tmp_path, "run_main", "tltl-run", [f"runs_dir={tmp_path}/runs"])


@pytest.fixture
def tltl(tmp_path):
    """Runs `tltl ARGUMENTS` in an empty folder: (exit code, stdout, stderr)."""
    return command(tmp_path, "main", "tltl", [])


def command(folder, function, name, always):
    code = f"import sys; sys.argv[0] = '{name}'; from tltlrl.cli import {function}; {function}()"
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONWARNINGS": "error"}

    def run(*arguments):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments, *always],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        return done.returncode, done.stdout, done.stderr

    return run
