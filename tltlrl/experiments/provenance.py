"""How an experiment was made, as its page tells it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from tltlrl.config.compare import flatten
from tltlrl.config.compose import compose
from tltlrl.errors import UserError
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
    page = study.settings.get("task", {}).get("file")
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
        _defaults(page) if page else _defaults_of(study.task.name),
    )


def _defaults(task: str) -> dict[str, Any]:
    """What a bare `tltl-run task=NAME` would be; nothing if it is not there (a robot's page that was moved)."""
    try:
        return flatten(compose([f"task={task}"]))
    except UserError:
        return {}


_defaults_of = cache(_defaults)  # for tasks by name, whose files do not change; composing takes 0.2 s
