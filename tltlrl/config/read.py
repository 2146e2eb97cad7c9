"""From a composed config to the experiment it describes; what is wrong in it is told here, before anything runs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from tltlrl.errors import UserError, nearest
from tltlrl.learning.reps import COVARIANCE_RULES
from tltlrl.logic import Spec, load_spec
from tltlrl.resources import spec_path
from tltlrl.tasks import task_entry
from tltlrl.tasks.task import Task
from tltlrl.training.loop import AlgorithmConfig, Case, Run, parse_case

Settings = TypeVar("Settings")


@dataclass(frozen=True)
class EngineConfig:
    """Where runs are computed: `address` of a Dask scheduler, or none for this machine."""

    address: str | None = None


@dataclass(frozen=True)
class Experiment:
    """A comparison: every case with every seed.

    Attributes:
      name: its folder's name.
      task, reward: config dataclasses of the task.
      spec: what is learned, and what every case is measured by.
      cases, seeds: what is compared.
      algorithm: the same for every case.
      trials: noisy trials of each learned policy.
      workers: processes; None for one per processor.
      engine: where they run.
      runs_dir: the folder above.
      overwrite: delete an older folder of that name first.
      settings: the config as given, less what does not change the results; kept in config.yaml.
    """

    name: str
    task: Any
    reward: Any
    spec: Spec
    cases: tuple[Case, ...]
    seeds: tuple[int, ...]
    algorithm: AlgorithmConfig
    trials: int
    workers: int | None
    engine: EngineConfig
    runs_dir: str
    overwrite: bool
    settings: dict[str, Any]

    def runs(self) -> list[Run]:
        """One run per case and seed, in the order of the tables."""
        return [
            Run(self.task, self.reward, self.spec, case, seed, self.algorithm, self.trials)
            for case in self.cases
            for seed in self.seeds
        ]


# More would be told by the machine's memory, and of the trials only after all training.
MOST_SEEDS = MOST_TRIALS = MOST_SAMPLES = 10_000
MOST_STEPS = 100_000
KEYS = {
    "name": str,
    "task": dict,
    "spec": str,
    "constants": dict,
    "reward": dict,
    "algorithm": dict,
    "cases": list,
    "seeds": (int, list),
    "trials": int,
    "workers": (int, type(None)),
    "engine": dict,
    "runs_dir": str,
    "overwrite": bool,
}
# What changes how, but not what: left out of a result's config.yaml.
MACHINERY_DEFAULTS: dict[str, Any] = {
    "workers": None,
    "engine": {"address": None},
    "runs_dir": "runs",
    "overwrite": False,
}


def experiment_from(config: Mapping[str, Any]) -> Experiment:
    """Reads and checks a config (plain dicts and lists, interpolations resolved).

    Raises:
      UserError: naming the key, what is wrong with it and what would be right.
      SpecError: if the spec is wrong.
    """
    for key in config:
        if key not in KEYS:
            raise UserError(f"{key}: no such key{nearest(key, KEYS)}")
    if type(config.get("name")) is int:  # name=2024
        config = {**config, "name": str(config["name"])}
    for key, kind in KEYS.items():
        if key not in config:
            raise UserError(f"{key}: missing from the config")
        kinds = kind if isinstance(kind, tuple) else (kind,)
        if not isinstance(config[key], kinds) or (isinstance(config[key], bool) and bool not in kinds):
            expected = " or ".join({"NoneType": "null"}.get(k.__name__, k.__name__) for k in kinds)
            raise UserError(f"{key}: expected {expected}, not {config[key]!r}")
    if not config["name"].isprintable() or not config["name"].strip(". ") or "/" in config["name"]:
        raise UserError(f"name: {config['name']!r} cannot be a folder's name")
    if not config["runs_dir"].strip():
        raise UserError("runs_dir: it is empty; give the folder above the experiments' folders, or . for this one")
    entry = task_entry(str(config["task"].get("name")))
    experiment = Experiment(
        name=config["name"],
        task=dataclass_from(entry.config, config["task"], "task"),
        reward=dataclass_from(entry.reward, config["reward"], "reward"),
        spec=load_spec(spec_path(config["spec"]), constants=config["constants"]),
        cases=_cases(config["cases"], list(entry.hand_made)),
        seeds=_seeds(config["seeds"]),
        algorithm=dataclass_from(AlgorithmConfig, config["algorithm"], "algorithm"),
        trials=_between("trials", config["trials"], 1, MOST_TRIALS),
        workers=None if config["workers"] is None else _between("workers", config["workers"], 1),
        engine=dataclass_from(EngineConfig, config["engine"], "engine"),
        runs_dir=config["runs_dir"],
        overwrite=config["overwrite"],
        settings={key: value for key, value in config.items() if key not in MACHINERY_DEFAULTS},
    )
    _between("task.steps", experiment.task.steps, most=MOST_STEPS)
    _check_algorithm(experiment.algorithm)
    _check_step(experiment.reward)
    for case in experiment.cases:  # builds each kind of task once: wrong geometry or missing constants show here
        task = experiment.runs()[experiment.cases.index(case) * len(experiment.seeds)].make_task()
        _check_signals(experiment.spec, task)
        task.make_physics()
    return experiment


def dataclass_from(kind: type[Settings], values: Mapping[str, Any], where: str) -> Settings:
    """An instance of a config dataclass, its keys and types checked.

    Raises:
      UserError: naming `where`.key.
    """
    names = [field.name for field in dataclasses.fields(kind)]  # type: ignore[arg-type]
    for key in values:
        if key not in names:
            raise UserError(f"{where}.{key}: no such key{nearest(str(key), names)}")
    if missing := [name for name in names if name not in values]:
        raise UserError(f"{where}.{missing[0]}: missing from the config; is {where} the one of this experiment?")
    settings: Any = OmegaConf.structured(kind)
    for key, value in values.items():
        try:
            settings = OmegaConf.merge(settings, {key: value})
        except OmegaConfBaseException as error:
            raise UserError(f"{where}.{key}: {str(error).splitlines()[0]}") from error
    result: Settings = OmegaConf.to_object(settings)  # type: ignore[assignment]
    for key in names:
        for number in _numbers(getattr(result, key)):
            if not math.isfinite(number):
                raise UserError(f"{where}.{key}: {number} is not a finite number")
    return result


def _numbers(value: Any) -> list[float]:
    if isinstance(value, dict):
        return _numbers(list(value.values()))
    if isinstance(value, list):
        return [number for part in value for number in _numbers(part)]
    return [value] if isinstance(value, float) else []


def _between(key: str, value: int, least: int | None = None, most: int | None = None) -> int:
    if least is not None and value < least:
        raise UserError(f"{key}: {value} is too small; it must be at least {least}")
    if most is not None and value > most:
        raise UserError(f"{key}: {value} is too large; it must be at most {most}")
    return value


def _cases(names: list[Any], hand_made: list[str]) -> tuple[Case, ...]:
    cases = tuple(parse_case(str(name), hand_made) for name in names)
    if not cases or len(set(cases)) < len(cases):
        raise UserError(f"cases: {names} must name at least one case, and each once")
    return cases


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


def _check_algorithm(a: AlgorithmConfig) -> None:
    _between("algorithm.iterations", a.iterations, 1)
    _between("algorithm.samples", a.samples, 2, MOST_SAMPLES)
    if a.covariance not in COVARIANCE_RULES:
        raise UserError(
            f"algorithm.covariance: no rule is named {a.covariance}{nearest(a.covariance, COVARIANCE_RULES)}"
        )
    bound = math.log(a.samples)
    if not 0 < a.epsilon < bound:
        raise UserError(
            f"algorithm.epsilon: {a.epsilon} must lie between 0 and log(algorithm.samples) = {bound:.3f}: "
            f"the weights of {a.samples} samples cannot be further from uniform. Lower it, or draw more samples."
        )
    if not 0 <= a.kept < 1:
        raise UserError(f"algorithm.kept: {a.kept} must be a share in [0, 1)")
    if not 0 < a.initial_std <= 100:
        raise UserError(
            f"algorithm.initial_std: {a.initial_std} must be a share of a full command, above 0 and at most 100"
        )
    if abs(a.feedback) > 1e6:
        raise UserError(f"algorithm.feedback: {a.feedback} cannot be simulated; it lies between -1e6 and 1e6")
    if a.correlation < 0:
        raise UserError(f"algorithm.correlation: {a.correlation} must be 0 or a width in steps")


def _check_step(reward: Any) -> None:
    """Whether what step-based REPS has of its own are coefficients of the reward."""
    names = [field.name for field in dataclasses.fields(reward) if field.name != "step"]
    for name in reward.step:
        if name not in names:
            raise UserError(f"reward.step.{name}: no such key{nearest(name, names)}")


def _check_signals(spec: Spec, task: Task) -> None:
    features, commands = task.reference()
    offered = {
        name: None if values.ndim == 2 else values.shape[2]
        for name, values in task.signals(features[None], commands[None]).items()
    }
    for name, dimension in spec.signals.items():
        if name not in offered:
            raise UserError(f"spec: it needs a signal {name}, which {task.name} has not{nearest(name, offered)}")
        if dimension != offered[name]:
            raise UserError(
                f"spec: it reads {name} as {_kind(dimension)}, but in {task.name} it is {_kind(offered[name])}"
            )


def _kind(dimension: int | None) -> str:
    return "a scalar" if dimension is None else f"a vector of {dimension}"


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat
