"""The origin of numbers: the code and versions that decide them, and the machine that computes them."""

from __future__ import annotations

import contextlib
import functools
import importlib.metadata
import importlib.util
import platform
import sys
from collections.abc import Mapping
from pathlib import Path

from tltlrl.registry import LEARNERS, TASKS
from tltlrl.store.files import digest_of_digests

NUMERIC = ("numpy", "scipy", "mujoco", "dm-control")  # packages that decide the numbers of every run
BESIDE = {"configs", "specs", "__pycache__"}  # what a wheel has inside of the package and a checkout beside it


def origin(task: str, learner: str) -> dict[str, str]:
    """The code and versions that decide the bytes of a run, apart from what is asked for.

    Args:
      task, learner: names in the registries.

    Returns:
      Name of the code or package => its version, or a digest of its files.
    """
    found = {"Python": f"{sys.version_info.major}.{sys.version_info.minor}", "code of tltlrl": code_digest("tltlrl")}
    packages = list(NUMERIC)
    for what, registry, name in (("task", TASKS, task), ("learner", LEARNERS, learner)):
        package = registry.address(name).partition(":")[0].partition(".")[0]
        if package != "tltlrl":
            found[f"code of the {what} {name}"] = code_digest(package)
        with contextlib.suppress(Exception):  # it cannot be imported here: the run will say so
            named = getattr(registry.get(name), "packages", ())
            packages += [named] if isinstance(named, str) else named
    return found | {name: _version(name) for name in packages}


def different(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """The differences between two origins, for a message; empty if there are none."""
    return ", ".join(
        f"{what}: {there.get(what, 'none')} there, {here.get(what, 'none')} here"
        for what in dict.fromkeys([*here, *there])
        if here.get(what) != there.get(what)
    )


@functools.cache
def code_digest(package: str) -> str:
    """The first digits of a SHA-256 of all files of an importable package or module, names included."""
    spec = importlib.util.find_spec(package)
    if spec is None:
        return "none"
    found = []
    for root in map(Path, spec.submodule_search_locations or [spec.origin or ""]):
        for path in sorted(root.rglob("*")) if root.is_dir() else [root]:
            parts = path.relative_to(root).parts
            if path.is_file() and not BESIDE & set(parts) and not any(part.startswith(".") for part in parts):
                found.append(("/".join(parts), path))
    return digest_of_digests(found)[:12]


def machine() -> str:
    """The name and the processor of this machine, for the manifest."""
    return f"{platform.node()} ({processor()})"


@functools.cache
def processor() -> str:
    """The model of this machine's processor, if the system says it."""
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
