"""Tasks and learners by name: the ones that come with tltlrl, and the ones that installed packages bring.

A name stands for "module:attribute", which is imported where it is used, also by a worker on another machine. A
package adds names by entry points of the groups `tltlrl.tasks` and `tltlrl.learners` in its pyproject.toml:

    [project.entry-points."tltlrl.tasks"]
    two_link = "my_package.two_link:TWO_LINK"

A config holds a name in these tables, never code to import.
"""

from __future__ import annotations

import functools
import importlib
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tltlrl.errors import UserError, nearest


@dataclass(frozen=True)
class Registry:
    """One table of names.

    Attributes:
      what: "task" or "learner", for messages.
      group: the entry points' group.
      built_in: name => "module:attribute"; a package cannot take one of these names.
      described: the same for names that messages do not list: each needs a file or an id from the user.
    """

    what: str
    group: str
    built_in: Mapping[str, str]
    described: Mapping[str, str] = field(default_factory=dict)

    def names(self) -> list[str]:
        """Every name: the built-in ones first, then those of packages in alphabetical order."""
        return [*self.built_in, *sorted(self._of_packages().keys() - self.built_in.keys() - self.described.keys())]

    def get(self, name: str) -> Any:
        """What the name stands for, imported.

        Raises:
          UserError: if there is no such name, or what it stands for cannot be imported.
        """
        address = self.address(name)
        module, _, attribute = address.partition(":")
        try:
            return getattr(importlib.import_module(module), attribute)
        except Exception as error:  # whatever the code of a package raises
            if name in self.built_in or name in self.described:
                raise
            raise UserError(
                f"the {self.what} {name} cannot be loaded from {address} ({error}); mend or uninstall its package"
            ) from error

    def address(self, name: str) -> str:
        """What the name stands for, as "module:attribute".

        Raises:
          UserError: if there is no such name.
        """
        address = self.built_in.get(name) or self.described.get(name) or self._of_packages().get(name)
        if address is None:
            raise UserError(f"no {self.what} is named {name}{nearest(name, self.names())}")
        return address

    def _of_packages(self) -> dict[str, str]:
        return _entry_points(self.group, tuple(sys.path))


@functools.cache
def _entry_points(group: str, _path: tuple[str, ...]) -> dict[str, str]:
    from importlib.metadata import entry_points  # slow; a start that needs only built-in names does without

    return {point.name: point.value for point in entry_points(group=group)}


TASKS = Registry(
    "task",
    "tltlrl.tasks",
    {
        "reach_avoid": "tltlrl.tasks.planar_arm:REACH_AVOID",
        "visit_in_order": "tltlrl.tasks.planar_arm:VISIT_IN_ORDER",
        "toast": "tltlrl.tasks.toast:TOAST",
    },
    {
        "mjcf": "tltlrl.tasks.mjcf:MJCF",
        "gymnasium": "tltlrl.tasks.outside:GYMNASIUM",
        "suite": "tltlrl.tasks.outside:SUITE",
    },
)
# Tasks that are an environment of others, chosen by task.id, and what loads one outside tltlrl.
OUTSIDE = {"gymnasium": "gymnasium.make", "suite": "dm_control.suite.load"}
LEARNERS = Registry(
    "learner",
    "tltlrl.learners",
    {
        "episodic": "tltlrl.learning.reps:EpisodeBased",
        "step": "tltlrl.learning.reps:StepBased",
        "cma": "tltlrl.learning.cma:CmaEs",
    },
)
