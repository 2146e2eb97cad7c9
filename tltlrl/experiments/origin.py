"""Whose numbers these are: the code and the versions that decide them, and the machine that they are computed on."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import platform
import sys
from collections.abc import Mapping
from pathlib import Path

from tltlrl.registry import LEARNERS, TASKS

NUMERIC = ("numpy", "scipy", "mujoco", "dm-control")  # what numbers come from beside our own code
BESIDE = {"configs", "specs", "__pycache__"}  # what a wheel has inside of the package and a checkout beside it


def origin(task: str, learner: str) -> dict[str, str]:
    """What decides the bytes of a run beside what it is asked for: two that differ here may differ in their numbers.

    Args:
      task, learner: names of the registry.

    Returns:
      What it is => its version, or a digest of its files.
    """
    found = {"Python": f"{sys.version_info.major}.{sys.version_info.minor}", "code of tltlrl": code_digest("tltlrl")}
    for what, registry, name in (("task", TASKS, task), ("learner", LEARNERS, learner)):
        package = registry.address(name).partition(":")[0].partition(".")[0]
        if package != "tltlrl":
            found[f"code of the {what} {name}"] = code_digest(package)
    names = (*NUMERIC, "cma") if learner == "cma" else NUMERIC
    return found | {name: _version(name) for name in names}


def different(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """What differs between two origins, for a message; empty if nothing does."""
    return ", ".join(
        f"{what}: {there.get(what, 'none')} there, {here.get(what, 'none')} here"
        for what in dict.fromkeys([*here, *there])
        if here.get(what) != there.get(what)
    )


@functools.cache
def code_digest(package: str) -> str:
    """The first digits of a SHA-256 of every file of an importable package, or of a module, by their names."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        return "none"
    total = hashlib.sha256()
    for root in map(Path, spec.submodule_search_locations or [spec.origin or ""]):
        for path in sorted(root.rglob("*")) if root.is_dir() else [root]:
            parts = path.relative_to(root).parts
            if path.is_file() and not BESIDE & set(parts) and not any(part.startswith(".") for part in parts):
                total.update("/".join(parts).encode() + hashlib.sha256(path.read_bytes()).digest())
    return total.hexdigest()[:12]


def machine() -> str:
    """The name and the processor of this one, for the manifest."""
    return f"{platform.node()} ({processor()})"


@functools.cache
def processor() -> str:
    """The model of this machine's processor, as far as the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "none"
