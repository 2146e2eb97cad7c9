"""The table of keys: the meaning, the bounds and the role of each key of a config.

Top-level keys are here. The keys of the sections `task`, `reward`, `algorithm` and `engine` are the fields of their
dataclasses, which hold the same data: see `tltlrl.settings` and `sections`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from tltlrl.config.machinery import Engine, Machinery
from tltlrl.learning.reps import RepsSettings
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.settings import Role, Setting, settings_of
from tltlrl.training.study import MOST_SEEDS, AlgorithmConfig, Study


@dataclass(frozen=True)
class Key:
    """One top-level key.

    Attributes:
      kinds: the types that its value may have.
      setting: its meaning, its roles and its bounds.
      default: the default of a machinery key, for a config without it.
    """

    kinds: tuple[type, ...]
    setting: Setting
    default: Any = None


_MACHINERY = settings_of(Machinery)
_SEARCHED = Role.SEARCHED | Role.CHOSEN
KEYS: dict[str, Key] = {
    "name": Key((str,), Setting("the results go to <runs_dir>/<name>", role=Role.NAMES)),
    "task": Key((dict,), Setting("what is simulated: its robot, its length, its noise", role=_SEARCHED)),
    "spec": Key((str,), Setting("a .tltl file: a path of your own, or one that comes with tltlrl", role=Role.PLACE)),
    "constants": Key((dict,), Setting("values for constants of the spec, in place of the file's")),
    "reward": Key((dict,), Setting("coefficients of the task's hand-made rewards", role=_SEARCHED)),
    "algorithm": Key((dict,), Setting("policy search, the same for every case", role=_SEARCHED)),
    "cases": Key((list,), Setting("what is compared: <reward>_<learner>", role=Role.GROWS)),
    "seeds": Key(
        (int, list),
        Setting("a list, or a number n for 0 .. n-1", most=MOST_SEEDS, role=Role.GROWS | Role.BUDGET),
    ),
    "trials": Key((int,), settings_of(Study)["trials"]),
    "workers": Key((int, type(None)), _MACHINERY["workers"], Machinery.workers),
    "engine": Key(
        (dict,),
        Setting(
            "where the workers are: on this machine, or of a Dask scheduler",
            role=Role.MACHINERY | Role.BUDGET | Role.CHOSEN,
        ),
        {"address": Engine.address},
    ),
    "runs_dir": Key((str,), _MACHINERY["runs_dir"], Machinery.runs_dir),
    "overwrite": Key((bool,), _MACHINERY["overwrite"], Machinery.overwrite),
}


def having(role: Role) -> list[str]:
    """The top-level keys with any of these roles."""
    return [name for name, key in KEYS.items() if key.setting.role & role]


def having_kind(kind: type) -> list[str]:
    """The top-level keys whose values may be of this type."""
    return [name for name, key in KEYS.items() if kind in key.kinds]


def result_keys() -> list[str]:
    """The keys in a result's config.yaml: all but machinery."""
    return [name for name, key in KEYS.items() if Role.MACHINERY not in key.setting.role]


def machinery_defaults() -> dict[str, Any]:
    """The defaults of machinery, which a result's config.yaml lacks."""
    return {name: key.default for name, key in KEYS.items() if Role.MACHINERY in key.setting.role}


def sections(task: str, learners: Iterable[str]) -> dict[str, Mapping[str, Setting]]:
    """Section => key => its meaning and its bounds.

    Args:
      task: a name in the registry of tasks.
      learners: names in the registry of learners.

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
    """The keys of the section `algorithm`, with the own keys of these learners.

    The keys of REPS are always there, because configs/algorithm/reps.yaml has values for them.
    """
    found = settings_of(AlgorithmConfig) | settings_of(RepsSettings)
    for kind in learners:
        found |= settings_of(kind)
    return found


def is_budget(key: str, learners: Iterable[type]) -> bool:
    """Whether a key of a config, with its section, has the role `Role.BUDGET`.

    Args:
      key: the key as in an override.
      learners: the settings dataclasses of the config's learners.
    """
    section, _, name = key.partition(".")
    if section == "algorithm":
        return (own := algorithm_settings(learners).get(name)) is not None and Role.BUDGET in own.role
    return section in KEYS and Role.BUDGET in KEYS[section].setting.role
