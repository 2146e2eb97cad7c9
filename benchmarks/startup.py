"""How long commands take before they do anything, beside the import of NumPy alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from benchmarks.simulation import Row, median_ratio
from tltlrl.resources import SPECS


def rows() -> list[Row]:
    """Every row of this module."""
    command = str(Path(sys.executable).with_name("tltl"))

    def ratio(*arguments: str) -> float:
        return median_ratio(lambda: _run(command, *arguments), lambda: _run(sys.executable, "-c", "import numpy"))

    return [
        ("tltl --help / import numpy, seconds", ratio("--help"), 1.2, "<="),
        ("tltl check SPEC / import numpy, seconds", ratio("check", str(SPECS / "toast.tltl")), 2.2, "<="),
    ]


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)
