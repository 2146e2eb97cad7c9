"""How an experiment was made, as its page tells it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from tltlrl.config.compare import flatten
from tltlrl.config.compose import compose, quoted, spec_of
from tltlrl.errors import UserError
from tltlrl.registry import OUTSIDE, TASKS
from tltlrl.reports.page import Provenance
from tltlrl.training.study import Study


def provenance(study: Study, content: Mapping[str, Any]) -> Provenance:
    """What manifest.json knows, and which settings are not those of a bare `tltl-run task=NAME`.

    Args:
      study: what was asked for.
      content: of manifest.json.
    """
    git = content["git"] or {}
    commit = f"{git.get('commit', 'not known')}{', with changes' if git.get('dirty') else ''}"
    return Provenance(
        [content["command"], *(session["command"] for session in content["later_sessions"])],
        {
            "tltlrl": content["packages"].get("tltlrl", "not known"),
            "commit": commit,
            "Python": content["python"],
            "machine": f"{content['platform']}, {content['cpu'].get('model', '')}",
            "started": content["started"],
        },
        flatten(study.settings),
        _defaults(study),
    )


def _defaults(study: Study) -> dict[str, Any]:
    """What a bare `tltl-run task=NAME` would be; nothing if it is not there (a robot's page that was moved)."""
    task = study.settings.get("task", {})
    if task.get("file"):
        return _composed(f"task={task['file']}")
    name = study.task.name
    if name in TASKS.built_in:
        return _built_in(name)
    needed = [f"task.id={task['id']}"] if name in OUTSIDE else []
    if spec_of(name) is None:
        needed.append(f"spec={quoted(study.settings['spec'])}")
    return _composed(f"task={name}", *needed)


def _composed(*overrides: str) -> dict[str, Any]:
    try:
        return flatten(compose(overrides))
    except UserError:
        return {}


@cache
def _built_in(name: str) -> dict[str, Any]:
    """Composed once, which takes 0.2 s: the files are tltlrl's own, while those of packages and users may change."""
    return _composed(f"task={name}")
