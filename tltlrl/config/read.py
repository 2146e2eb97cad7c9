"""Turns a composed config into the study that it describes, and reports mistakes before anything runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from tltlrl.config.keys import KEYS, algorithm_settings, result_keys
from tltlrl.config.machinery import Engine, Machinery
from tltlrl.errors import UserError, nearest
from tltlrl.learning.reps import RepsSettings
from tltlrl.logic import load_spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.resources import spec_path, user_path
from tltlrl.settings import Role, fields_with
from tltlrl.training.study import MOST_SEEDS, TLTL, AlgorithmConfig, Case, Stage, Study, in_second_stage

Settings = TypeVar("Settings")


def read(config: Mapping[str, Any]) -> tuple[Study, Machinery]:
    """Reads and checks a config (plain dicts and lists, interpolations resolved).

    Raises:
      UserError: if a key is wrong; it names the key, what is wrong and what would be right.
      SpecError: if the spec has a mistake.
    """
    config = _of_the_right_kinds(config)
    address = dataclass_from(Engine, config["engine"], "engine").address
    machinery = Machinery(config["workers"], address, config["runs_dir"], config["overwrite"])
    # Mistakes in these keys are reported before MuJoCo is imported, which is slow.
    seeds = seeds_of(config["seeds"])
    spec = load_spec(spec_path(config["spec"]), config["constants"])

    from tltlrl.training.build import make_task
    from tltlrl.training.check import check

    if isinstance(named := config["task"].get("name"), dict | list):
        raise UserError(f"task.name: expected the name of a task, not {named!r}")
    entry = TASKS.get(str(named))
    cases = [case_of(str(name), entry.hand_made) for name in config["cases"]]
    names = list(dict.fromkeys(case.learner for case in cases))
    if policy := config["algorithm"].get("policy"):  # for workers elsewhere, too
        config["algorithm"] = {**config["algorithm"], "policy": str(user_path(str(policy)).resolve())}
    algorithm, learners = _algorithm(config["algorithm"], names)
    task: Any = dataclass_from(entry.config, config["task"], "task")
    reward: Any = dataclass_from(entry.reward, config["reward"], "reward")
    settings = {key: value for key, value in config.items() if key in result_keys()}
    for learner in learners.values():  # a learner's defaults are kept with the results
        settings["algorithm"] = settings["algorithm"] | dataclasses.asdict(learner)
    study = Study(
        name=config["name"],
        task=task,
        reward=reward,
        spec=spec.sampled(make_task(task).control_timestep),
        cases=tuple(cases),
        seeds=seeds,
        algorithm=algorithm,
        learners=learners,
        refine=_refinement(config["algorithm"], names),
        trials=config["trials"],
        settings=settings,
    )
    check(study)
    return study, machinery


def _of_the_right_kinds(config: Mapping[str, Any]) -> dict[str, Any]:
    for given in config:
        if given not in KEYS:
            raise UserError(f"{given}: no such key{nearest(given, KEYS)}")
    whole = dict(config)
    if type(config.get("name")) is int:  # name=2024
        whole["name"] = str(config["name"])
    for name, key in KEYS.items():
        if name not in whole:
            raise UserError(f"{name}: missing from the config")
        value = whole[name]
        if not isinstance(value, key.kinds) or (isinstance(value, bool) and bool not in key.kinds):
            expected = " or ".join({"NoneType": "null"}.get(kind.__name__, kind.__name__) for kind in key.kinds)
            raise UserError(f"{name}: expected {expected}, not {value!r}")
    return whole


def case_of(name: str, hand_made: Sequence[str]) -> Case:
    """The case with a name <reward>_<learner>.

    Args:
      name: a name such as tltl_episodic.
      hand_made: the task's hand-made rewards.

    Raises:
      UserError: if there is no such case.
    """
    cases = {
        case.name: case
        for case in (Case(reward, learner) for reward in (TLTL, *hand_made) for learner in LEARNERS.names())
    }
    if name not in cases:
        raise UserError(f"cases: no case is named {name}{nearest(name, cases)}")
    return cases[name]


def _algorithm(
    values: Mapping[str, Any], learners: Iterable[str], where: str = "algorithm"
) -> tuple[AlgorithmConfig, dict[str, Any]]:
    """The section `algorithm`: the settings that all learners share, and learner => its own settings.

    A learner's own key that the config lacks gets its default.
    """
    kinds = {name: LEARNERS.get(name).Settings for name in learners}
    _known(values, algorithm_settings(kinds.values()), where)

    def of(kind: type[Settings]) -> dict[str, Any]:
        names = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
        return {key: value for key, value in values.items() if key in names}

    common = dataclass_from(AlgorithmConfig, of(AlgorithmConfig), where)
    if RepsSettings not in kinds.values():  # its keys are there all the same, where no learner has them itself
        own = [field.name for kind in kinds.values() for field in dataclasses.fields(kind)]
        unread = {key: value for key, value in of(RepsSettings).items() if key not in own}
        dataclass_from(RepsSettings, unread, where, defaults=True)
    return common, {name: dataclass_from(kind, of(kind), where, defaults=True) for name, kind in kinds.items()}


def _refinement(values: Mapping[str, Any], learners: Iterable[str]) -> dict[str, Stage]:
    """The second stage of each learner, from `algorithm.refine`; empty if there is none."""
    changed = dict(values.get("refine") or {})
    if not changed:
        return {}
    where, after = "algorithm.refine", changed.pop("after", None)
    if type(after) is not int or after < 1:
        raise UserError(f"{where}.after: expected the iterations of the first stage, a whole number, not {after!r}")
    same = [name for name in fields_with(Role.COMMON, AlgorithmConfig) if name in changed]
    if same:
        raise UserError(
            f"{where}.{same[0]}: it is the same in both stages; set algorithm.{same[0]}, and leave it out here"
        )
    kinds = {name: LEARNERS.get(name).Settings for name in learners}
    _known(changed, algorithm_settings(kinds.values()), where)
    with in_second_stage(changed):
        algorithm, own = _algorithm({**values, **changed, "refine": {}}, learners, where)
    return {name: Stage(after, algorithm, own[name]) for name in learners}


def seeds_of(seeds: int | Sequence[int]) -> tuple[int, ...]:
    """The seeds that the key `seeds` stands for: a list of seeds, or a number n for the first n.

    Raises:
      UserError: if there are none, or too many.
    """
    if not isinstance(seeds, int):
        return tuple(seeds)
    if seeds < 1:
        raise UserError(
            f"seeds: {seeds} must be a number n >= 1 for the seeds 0 .. n-1, or a list, as seeds=[{max(seeds, 0)}]"
        )
    if seeds > MOST_SEEDS:
        raise UserError(f"seeds: {seeds} are too many; at most {MOST_SEEDS}, or a list of the seeds themselves")
    return tuple(range(seeds))


def dataclass_from(kind: type[Settings], values: Mapping[str, Any], where: str, defaults: bool = False) -> Settings:
    """Makes an instance of a config dataclass, with keys and types checked.

    Args:
      kind: the dataclass; it checks its own bounds.
      values: field => value.
      where: the section, for messages.
      defaults: whether fields with a default may be left out.

    Raises:
      UserError: if a key is wrong; it names `where`.key.
    """
    names = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
    _known(values, names, where)
    if not defaults and (missing := [name for name in names if name not in values]):
        raise UserError(f"{where}.{missing[0]}: missing from the config; is {where} the one of this experiment?")
    settings: Any = OmegaConf.structured(kind)
    for key, value in values.items():
        try:
            settings = OmegaConf.merge(settings, {key: value})
        except OmegaConfBaseException as error:
            said = str(error).splitlines()[0]
            said = said.replace("of type 'DictConfig'", "of type 'mapping'").replace(
                "of type 'ListConfig'", "of type 'list'"
            )
            raise UserError(f"{where}.{key}: {said}") from error
    result: Settings = OmegaConf.to_object(settings)  # type: ignore[assignment]
    return result


def _known(values: Iterable[str], names: Iterable[str], where: str) -> None:
    valid = [f"{where}.{name}" for name in names]
    for key in (f"{where}.{name}" for name in values):
        if key not in valid:
            raise UserError(f"{key}: no such key{nearest(key, valid)}")
