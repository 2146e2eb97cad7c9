"""From a composed config to the study it describes; what is wrong in it is told here, before anything runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from tltlrl.config.keys import KEYS, MACHINERY_DEFAULTS, EngineConfig, algorithm_settings
from tltlrl.errors import UserError, nearest
from tltlrl.logic import load_spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.resources import spec_path
from tltlrl.tasks.task import TaskEntry
from tltlrl.training import build
from tltlrl.training.study import MOST_SEEDS, TLTL, AlgorithmConfig, Case, Study

Settings = TypeVar("Settings")


@dataclass(frozen=True)
class Machinery:
    """How and where a study is computed; nothing of it changes a result.

    Attributes:
      workers: processes; None for one per processor.
      engine: where they run.
      runs_dir: the folder above those of experiments.
      overwrite: delete an older folder of the study's name first.
    """

    workers: int | None
    engine: EngineConfig
    runs_dir: str
    overwrite: bool

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise UserError(f"workers: {self.workers} is too small; it must be at least 1")
        if not self.runs_dir.strip():
            raise UserError("runs_dir: it is empty; give the folder above the experiments' folders, or . for this one")


def read(config: Mapping[str, Any]) -> tuple[Study, Machinery]:
    """Reads and checks a config (plain dicts and lists, interpolations resolved).

    Raises:
      UserError: naming the key, what is wrong with it and what would be right, or the place in the spec.
    """
    config = _of_their_kinds(config)
    machinery = Machinery(
        config["workers"],
        dataclass_from(EngineConfig, config["engine"], "engine"),
        config["runs_dir"],
        config["overwrite"],
    )
    entry: TaskEntry = TASKS.get(str(config["task"].get("name")))
    task: Any = dataclass_from(entry.config, config["task"], "task")
    reward: Any = dataclass_from(entry.reward, config["reward"], "reward")
    cases = tuple(parse_case(str(name), entry.hand_made) for name in config["cases"])
    algorithm, learners = _algorithm(config["algorithm"], tuple(dict.fromkeys(case.learner for case in cases)))
    whole = {"task": dataclasses.asdict(task), "reward": dataclasses.asdict(reward)}
    whole["algorithm"] = config["algorithm"] | dataclasses.asdict(algorithm)
    for own in learners.values():
        whole["algorithm"] |= dataclasses.asdict(own)
    study = Study(
        name=config["name"],
        task=task,
        reward=reward,
        spec=load_spec(spec_path(config["spec"]), constants=config["constants"]),
        cases=cases,
        seeds=_seeds(config["seeds"]),
        algorithm=algorithm,
        learners=learners,
        trials=config["trials"],
        settings={key: whole.get(key, value) for key, value in config.items() if key not in MACHINERY_DEFAULTS},
    )
    build.check(study)
    return study, machinery


def _of_their_kinds(config: Mapping[str, Any]) -> dict[str, Any]:
    """The config, if it has every key, each with a value of its kind, and no other."""
    for given in config:
        if given not in KEYS:
            raise UserError(f"{given}: no such key{nearest(given, KEYS)}")
    if type(config.get("name")) is int:  # name=2024
        config = {**config, "name": str(config["name"])}
    for name, key in KEYS.items():
        if name not in config:
            raise UserError(f"{name}: missing from the config")
        value = config[name]
        if not isinstance(value, key.kinds) or (isinstance(value, bool) and bool not in key.kinds):
            expected = " or ".join({"NoneType": "null"}.get(k.__name__, k.__name__) for k in key.kinds)
            raise UserError(f"{name}: expected {expected}, not {value!r}")
    return dict(config)


def parse_case(name: str, hand_made: Sequence[str]) -> Case:
    """The case of that name: a reward and a learner.

    Raises:
      UserError: if there is none.
    """
    for reward in (TLTL, *hand_made):
        learner = name.removeprefix(f"{reward}_")
        if learner != name and learner in LEARNERS.names() and (reward, learner) in _possible(hand_made, [learner]):
            return Case(reward, learner)
    cases = [Case(*pair).name for pair in _possible(hand_made, LEARNERS.names())]
    raise UserError(f"cases: no case is named {name}{nearest(name, cases)}")


def _possible(hand_made: Sequence[str], learners: Sequence[str]) -> list[tuple[str, str]]:
    """Rewards and learners that go together: robustness is known at the end only, so never by step."""
    by_step = {name: LEARNERS.get(name).by_step for name in learners}
    return [(r, name) for r in (TLTL, *hand_made) for name in learners if r != TLTL or not by_step[name]]


def _algorithm(values: Mapping[str, Any], learners: tuple[str, ...]) -> tuple[AlgorithmConfig, dict[str, Any]]:
    """What all learners share, and the own settings of each, from the section that holds both."""
    known = algorithm_settings(learners)
    for key in values:
        if key not in known:
            raise UserError(f"algorithm.{key}: no such key{nearest(str(key), known)}")

    def of(kind: type, whole: bool) -> Any:
        names = {field.name for field in dataclasses.fields(kind)}
        return dataclass_from(kind, {key: value for key, value in values.items() if key in names}, "algorithm", whole)

    own = {name: of(LEARNERS.get(name).Settings, name in LEARNERS.built_in) for name in learners}
    return of(AlgorithmConfig, True), own


def dataclass_from(kind: type[Settings], values: Mapping[str, Any], where: str, whole: bool = True) -> Settings:
    """An instance of a config dataclass, its keys and types checked.

    Args:
      kind: the dataclass.
      values: of its fields.
      where: the section's name, for messages.
      whole: whether a field that is not given is a mistake; otherwise it has its default.

    Raises:
      UserError: naming `where`.key.
    """
    names = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
    for key in values:
        if key not in names:
            raise UserError(f"{where}.{key}: no such key{nearest(str(key), names)}")
    if whole and (missing := [name for name in names if name not in values]):
        raise UserError(f"{where}.{missing[0]}: missing from the config; is {where} the one of this experiment?")
    settings: Any = OmegaConf.structured(kind)
    for key, value in values.items():
        try:
            settings = OmegaConf.merge(settings, {key: value})
        except OmegaConfBaseException as error:
            raise UserError(f"{where}.{key}: {str(error).splitlines()[0]}") from error
    result: Settings = OmegaConf.to_object(settings)  # type: ignore[assignment]
    return result


def _seeds(seeds: Any) -> tuple[int, ...]:
    if isinstance(seeds, int) and seeds > MOST_SEEDS:
        raise UserError(f"seeds: {seeds} are too many; at most {MOST_SEEDS}, or a list of the seeds themselves")
    listed = list(range(seeds)) if isinstance(seeds, int) else seeds
    wrong = [s for s in listed if not isinstance(s, int) or isinstance(s, bool) or not 0 <= s < 2**63]
    if wrong or not listed or len(set(listed)) < len(listed):
        raise UserError(
            f"seeds: {seeds!r} must be a number n >= 1 for the seeds 0 .. n-1, or a list of different numbers >= 0"
        )
    return tuple(listed)
