"""What a result was made with: versions, code, machine, config, spec."""

from __future__ import annotations

import datetime
import hashlib
import importlib.metadata
import os
import platform
import re
import subprocess
from pathlib import Path
from typing import Any

from tltlrl.config import Experiment


def manifest(experiment: Experiment, command: list[str], started: str | None = None) -> dict[str, Any]:
    """The content of manifest.json; `ended` is null in the one written at the start."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return {
        "command": command,
        "started": started or now,
        "ended": now if started else None,
        "python": platform.python_version(),
        "packages": _versions(),
        "git": _git(),
        "platform": platform.platform(),
        "cpu": {"model": _cpu(), "count": os.cpu_count()},
        "specs": {
            Path(experiment.spec.path or "spec.tltl").name: hashlib.sha256(experiment.spec.text.encode()).hexdigest()
        },
        "config": experiment.settings,
    }


def _versions() -> dict[str, str]:
    """tltlrl and everything it depends on directly."""
    try:
        required = importlib.metadata.requires("tltlrl") or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    names = [re.split(r"[^\w.-]", line)[0] for line in required if "extra ==" not in line]
    return {name: importlib.metadata.version(name) for name in ["tltlrl", *names]}


def _git() -> dict[str, Any] | None:
    """Commit and whether the tree had changes; null outside a checkout."""

    def git(*arguments: str) -> str:
        folder = Path(__file__).parent
        return subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()

    try:
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain"))}
    except (OSError, subprocess.SubprocessError):
        return None


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()
