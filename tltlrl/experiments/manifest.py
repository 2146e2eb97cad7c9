"""The manifest of an experiment: the versions, code, machine, config and spec that it was made with."""

from __future__ import annotations

import datetime
import functools
import importlib.metadata
import json
import os
import platform
import re
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tltlrl.config.compare import differences
from tltlrl.config.keys import machinery_defaults, result_keys
from tltlrl.errors import UserError
from tltlrl.experiments.folder import read_record
from tltlrl.experiments.origin import code_digest, processor
from tltlrl.resources import spec_path
from tltlrl.store.bounded import read_json
from tltlrl.store.files import digest
from tltlrl.store.layout import CONFIG, SPECS, START
from tltlrl.training.study import Study, with_later

CONTENT = {
    "command", "started", "ended", "python", "packages", "git", "platform", "cpu", "specs", "config", "later_sessions",
}  # fmt: skip

SEAL = "sha256"


def start_session(command: list[str]) -> dict[str, Any]:
    """The record of a session that begins now: command line, time, versions, code, machine."""
    return {
        "command": command,
        "started": _now(),
        "ended": None,
        "python": platform.python_version(),
        "packages": _versions(),
        "git": _git(),
        "code": code_digest("tltlrl"),
        "platform": platform.platform(),
        "cpu": {"model": processor(), "count": os.cpu_count()},
        "computed": {},
    }


def with_computed(session: Mapping[str, Any], run: str, machine: str) -> dict[str, Any]:
    """The session with one more run and the machine that computed its last iterations."""
    return {**session, "computed": {**session["computed"], run: machine}}


def end_session(session: Mapping[str, Any]) -> dict[str, Any]:
    """The session with the time of its end."""
    return {**session, "ended": _now()}


def manifest(study: Study, before: Mapping[str, Any] | None, session: Mapping[str, Any]) -> dict[str, Any]:
    """The content of manifest.json: the first session, what it was asked for, and every later session that computed.

    Args:
      study: what is computed.
      before: the manifest of earlier sessions, if any.
      session: the present session.
    """
    first, later = (before, [*before["later_sessions"], session]) if before else (session, [])
    sessions = {key: first[key] for key in session if key in first} | {"later_sessions": later}
    noticed = {"noticed": before["noticed"]} if before and "noticed" in before else {}
    return _sealed(sessions | _asked(study) | noticed)


def put_right(study: Study, changed: Mapping[str, Any]) -> dict[str, Any]:
    """Repairs a manifest that was changed: puts what was asked for right, and keeps its sessions with a mark.

    Args:
      study: what the folder holds.
      changed: the manifest.
    """
    noticed = f"{_now()}: this file was not as it was written; what it says of sessions before is kept as it stood"
    return _sealed({**changed, **_asked(study), "noticed": [*changed.get("noticed", []), noticed]})


def _asked(study: Study) -> dict[str, Any]:
    """The part of a manifest that says what was asked for."""
    return {
        "specs": {spec_name(study): digest(study.spec.text.encode())},
        "config": study.settings,
        "start": None if (start := study.algorithm.start()) is None else {study.algorithm.policy: digest(start)},
    }


def _sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """The manifest with a digest of its content. It protects against accidents, but is no signature."""
    rest = {key: value for key, value in content.items() if key != SEAL}
    return {**rest, SEAL: digest(json.dumps(rest, sort_keys=True).encode())}


def intact(content: Mapping[str, Any]) -> bool | None:
    """Whether a manifest is as it was written; None if it has no seal, as in version 0.1."""
    return _sealed(content)[SEAL] == content[SEAL] if SEAL in content else None


def read_manifest(path: Path) -> dict[str, Any] | None:
    """The content of manifest.json; None if there is none, or it is not whole."""
    try:
        content = read_json(path)
    except (OSError, ValueError):
        return None
    whole = (
        isinstance(content, dict)
        and content.keys() >= CONTENT
        and isinstance(content["later_sessions"], list)
        and isinstance(content["specs"], dict)
        and len(content["specs"]) == 1
        and isinstance(content["config"], dict)
        and isinstance(content["config"].get("spec"), str)
    )
    return content if whole else None


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def settings_in(path: Path) -> dict[str, Any]:
    """A complete config from a manifest.json, for results beside the old ones, with the spec's text as it was.

    Machinery is never taken from the file: only the command decides what to delete and where to connect.

    Raises:
      UserError: if the manifest cannot be read.
    """
    content = read_manifest(path)
    if content is None:
        raise UserError(
            f"{path}: {'not' if path.exists() else 'there is no such file; give'} the manifest.json of an experiment"
        )
    if intact(content) is False:
        raise UserError(
            f"{path}: it is not as it was written{_difference(path, content)}; write changes on the command line, as "
            f"in --from {path} algorithm.epsilon=0.5, and put back the file as it was (the experiment's own command "
            "does)"
        )
    settings = (
        with_start_of(path.parent, with_later(content["config"]))
        | machinery_defaults()
        | {"runs_dir": str(path.resolve().parent.parent)}
    )
    ((name, expected),) = content["specs"].items()
    try:
        text = spec_path(settings["spec"]).read_bytes().decode("utf-8-sig")
        unchanged = digest(text.encode()) == expected
    except UserError:
        unchanged = False
    return settings if unchanged else settings | {"spec": str(path.parent / SPECS / Path(name).name)}


def _difference(path: Path, content: Mapping[str, Any]) -> str:
    """What its config says in another way than config.yaml beside it, if that is there."""
    beside = read_record(path.parent / CONFIG, result_keys())
    lines = differences(beside, content["config"]) if beside else ""
    return (
        f" ({'; '.join(line.strip() for line in lines.splitlines())})".replace(" there, ", f" in {CONFIG}, ")
        if lines
        else ""
    )


def with_start_of(folder: Path, settings: Mapping[str, Any]) -> dict[str, Any]:
    """A result's config, with `algorithm.policy` replaced by the result's own copy of that file, if it has one."""
    copy = folder / START
    if not (settings["algorithm"].get("policy") and copy.exists()):
        return dict(settings)
    return {**settings, "algorithm": {**settings["algorithm"], "policy": str(copy)}}


def spec_name(study: Study) -> str:
    """The name of the spec's copy."""
    return Path(study.spec.path or "spec.tltl").name


@functools.cache
def _versions() -> dict[str, str]:
    """The versions of all installed packages, because any dependency of a dependency can change a result."""
    installed = {re.sub("[-_.]+", "-", d.name).lower(): d.version for d in importlib.metadata.distributions()}
    return dict(sorted(installed.items()))


def _git() -> dict[str, Any] | None:
    """The commit, and whether the tree had changes; None if this code is not in a checkout."""

    def git(*arguments: str) -> str:
        folder = Path(__file__).parent
        return subprocess.run(
            ["git", *arguments], cwd=folder, capture_output=True, text=True, check=True, timeout=10
        ).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", Path(__file__).name)  # or it lies in an environment within another project
        return {"commit": git("rev-parse", "HEAD"), "dirty": bool(git("status", "--porcelain"))}
    except (OSError, subprocess.SubprocessError):
        return None
