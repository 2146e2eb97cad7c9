"""The one table of keys: what each may hold, what it decides, and what it means.

The help page, the refusal of a changed folder, `-m`, `tltl search` and the reader of manifests all read it. The keys
of the sections (task, reward, algorithm, engine) stand beside their values, in the dataclasses' `setting` fields.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

from tltlrl.registry import LEARNERS
from tltlrl.settings import Setting, setting, settings_of
from tltlrl.training.study import AlgorithmConfig


class Role(Enum):
    """What a key decides."""

    RESULT = "what the results are"
    GROWS = "which runs there are: more extend a folder, anything else makes it another experiment"
    BUDGET = "how dear the results are; a search looks for values with less"
    NAME = "what the results are called"
    PLACE = "where the results lie"
    MACHINERY = "how they are computed, never what comes out"


@dataclass(frozen=True)
class Key:
    """One key at the top of a config.

    Attributes:
      kinds: types of its value.
      meaning: for the help page.
      role: what it decides.
      searched: whether `tltl search` may vary it; trials of another spec or other seeds could not be compared.
      default: of places and machinery, which a result's config.yaml does not keep.
    """

    kinds: tuple[type, ...]
    meaning: str
    role: Role = Role.RESULT
    searched: bool = False
    default: Any = None


KEYS = {
    "name": Key((str,), "the results go to <runs_dir>/<name>", Role.NAME),
    "task": Key((dict,), "what is simulated: its robot, its length, its noise", searched=True),
    "spec": Key((str,), "a .tltl file: a path of your own, or one that comes with tltlrl"),
    "constants": Key((dict,), "values for constants of the spec, in place of the file's"),
    "reward": Key((dict,), "coefficients of the task's hand-made rewards", searched=True),
    "algorithm": Key((dict,), "policy search, the same for every case", searched=True),
    "cases": Key((list,), "what is compared: <reward>_<learner>", Role.GROWS),
    "seeds": Key((int, list), "a list, or a number n for 0 .. n-1", Role.GROWS),
    "trials": Key((int,), "noisy trials of each learned policy, for the success rate", Role.BUDGET),
    "workers": Key((int, type(None)), "processes; null for one per processor, at most one per run", Role.MACHINERY),
    "engine": Key((dict,), "where runs are computed", Role.MACHINERY, default={"address": None}),
    "runs_dir": Key((str,), "the folder above those of experiments", Role.PLACE, default="runs"),
    "overwrite": Key((bool,), "delete an existing folder of that name first", Role.MACHINERY, default=False),
}
MACHINERY_DEFAULTS = {name: key.default for name, key in KEYS.items() if key.role in (Role.MACHINERY, Role.PLACE)}
GROWING = tuple(name for name, key in KEYS.items() if key.role is Role.GROWS)
# Swept or not, these are not in a folder's name: they name it themselves, change only how, or let it grow.
NOT_IN_THE_NAME = ("experiment", "name", *GROWING, *MACHINERY_DEFAULTS)
NOT_SEARCHED = ("experiment", *(name for name, key in KEYS.items() if not key.searched))


@dataclass(frozen=True)
class EngineConfig:
    """Where runs are computed: one worker runs in this process, more in a local cluster or on a Dask scheduler."""

    address: str | None = setting("of a Dask scheduler, as in tcp://127.0.0.1:8786; null for this machine", None)


def algorithm_settings(learners: tuple[str, ...]) -> dict[str, Setting]:
    """The keys of `algorithm` for these learners; those of REPS are always allowed."""
    kinds = [LEARNERS.get(name).Settings for name in dict.fromkeys(("episodic", *learners))]
    return {name: own for kind in (AlgorithmConfig, *kinds) for name, own in settings_of(kind).items()}


# What makes a search cheaper than the experiment, and its machinery: not in the command of the best candidate.
BUDGET = (
    *(name for name, key in KEYS.items() if key.role in (Role.BUDGET, Role.NAME, Role.MACHINERY)),
    "seeds",
    "engine.address",
    *(f"algorithm.{name}" for name, own in settings_of(AlgorithmConfig).items() if own.budget),
)


def flatten(config: Any, prefix: str = "") -> dict[str, Any]:
    """Nested keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, dict) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
