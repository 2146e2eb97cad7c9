"""How an experiment was made, as its page tells it."""

from __future__ import annotations

from collections.abc import Mapping
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
    task = study.settings.get("task", {})
    try:
        defaults = flatten(compose([f"task={task.get('file') or study.task.name}"]))
    except UserError:  # the page of a robot that lies elsewhere now
        defaults = {}
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
        defaults,
    )
