"""The table of keys: what each key of a config means, may be, and is for.

Here are the top-level keys. Those of the sections `task`, `reward`, `algorithm` and `engine` are the fields of the
dataclasses that the sections become, and say the same of themselves: see `tltlrl.settings` and `sections`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Flag, auto
from typing import Any

from tltlrl.config.machinery import Engine, Machinery
from tltlrl.learning.reps import RepsSettings
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.settings import Setting, settings_of
from tltlrl.training.study import MOST_SEEDS, AlgorithmConfig, Study


class Role(Flag):
    """What a key is for.

    RESULT: another value makes another experiment. NAMES: so does this, and it says where the results lie. GROWS: more
    of it extends a folder. BUDGET: it is for one command alone, as it makes results cheaper or dearer; the command of a
    search's best candidate leaves it out. SEARCHED: `tltl search` may vary it. MACHINERY: how, but not what; a result's
    config.yaml leaves it out.
    """

    RESULT = auto()
    NAMES = auto()
    GROWS = auto()
    BUDGET = auto()
    SEARCHED = auto()
    MACHINERY = auto()


@dataclass(frozen=True)
class Key:
    """One top-level key.

    Attributes:
      kinds: the types that it may have.
      setting: its meaning and its bounds.
      role: what it is for.
      default: of machinery, for a config that does not say it.
    """

    kinds: tuple[type, ...]
    setting: Setting
    role: Role = Role.RESULT
    default: Any = None


_STUDY, _MACHINERY = settings_of(Study), settings_of(Machinery)
KEYS: dict[str, Key] = {
    "name": Key((str,), Setting("the results go to <runs_dir>/<name>"), Role.NAMES),
    "task": Key((dict,), Setting("what is simulated: its robot, its length, its noise"), Role.RESULT | Role.SEARCHED),
    "spec": Key((str,), Setting("a .tltl file: a path of your own, or one that comes with tltlrl")),
    "constants": Key((dict,), Setting("values for constants of the spec, in place of the file's")),
    "reward": Key((dict,), Setting("coefficients of the task's hand-made rewards"), Role.RESULT | Role.SEARCHED),
    "algorithm": Key((dict,), Setting("policy search, the same for every case"), Role.RESULT | Role.SEARCHED),
    "cases": Key((list,), Setting("what is compared: <reward>_<learner>"), Role.GROWS),
    "seeds": Key((int, list), Setting("a list, or a number n for 0 .. n-1", most=MOST_SEEDS), Role.GROWS | Role.BUDGET),
    "trials": Key((int,), _STUDY["trials"], Role.RESULT | Role.BUDGET),
    "workers": Key((int, type(None)), _MACHINERY["workers"], Role.MACHINERY | Role.BUDGET, Machinery.workers),
    "engine": Key(
        (dict,),
        Setting("where the workers are: on this machine, or of a Dask scheduler"),
        Role.MACHINERY | Role.BUDGET,
        {"address": Engine.address},
    ),
    "runs_dir": Key((str,), _MACHINERY["runs_dir"], Role.MACHINERY | Role.NAMES, Machinery.runs_dir),
    "overwrite": Key((bool,), _MACHINERY["overwrite"], Role.MACHINERY | Role.BUDGET, Machinery.overwrite),
}


def having(role: Role) -> list[str]:
    """The keys with any of these roles."""
    return [name for name, key in KEYS.items() if key.role & role]


def kept() -> list[str]:
    """The keys of a result's config.yaml: those that say what it is, and not how it was computed."""
    return [name for name, key in KEYS.items() if not key.role & Role.MACHINERY]


def machinery_defaults() -> dict[str, Any]:
    """What makes a whole config of a result's config.yaml."""
    return {name: key.default for name, key in KEYS.items() if key.role & Role.MACHINERY}


def sections(task: str, learners: Iterable[str]) -> dict[str, Mapping[str, Setting]]:
    """Section => its key => what that means and may be.

    Args:
      task: a name of the registry.
      learners: names of the registry.

    Raises:
      UserError: if there is no such task or learner.
    """
    entry = TASKS.get(task)
    return {
        "task": settings_of(entry.config),
        "reward": settings_of(entry.reward),
        "algorithm": algorithm_settings(LEARNERS.get(name).Settings for name in learners),
        "engine": settings_of(Engine),
    }


def algorithm_settings(learners: Iterable[type]) -> dict[str, Setting]:
    """The keys of the section `algorithm`, for these learners' own dataclasses.

    Those of REPS are always there, since configs/algorithm/reps.yaml has values for them.
    """
    found = settings_of(AlgorithmConfig) | settings_of(RepsSettings)
    for kind in learners:
        found |= settings_of(kind)
    return found


def is_budget(key: str, learners: Iterable[type]) -> bool:
    """Whether a key of a config, dotted within its section, is for one command alone; see `Role.BUDGET`.

    Args:
      key: as an override has it.
      learners: the dataclasses of the settings of those that the config is for.
    """
    section, _, name = key.partition(".")
    if section == "algorithm":
        return (own := algorithm_settings(learners).get(name)) is not None and own.budget
    return section in KEYS and Role.BUDGET in KEYS[section].role
