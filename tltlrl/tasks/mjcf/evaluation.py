"""The page with its other values for trials of learned policies, and where its mistakes are."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

from tltlrl.settings import setting
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.model import Told
from tltlrl.tasks.mjcf.page import mistake

At = Callable[..., Told]  # the keys that lead to a value => what is wrong with it => the error that says where


@dataclass(frozen=True)
class EvaluationConfig(RobotConfig):
    """A page with the other values of its key `evaluation`.

    Attributes:
      trained: the page itself; features stay the same as there, whatever else is in the scene.
    """

    trained: RobotConfig = setting("the page itself", RobotConfig())


def evaluation_of(config: RobotConfig) -> RobotConfig:
    """The config of the scene for trials of learned policies."""
    if not config.evaluation:
        return config
    values = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    return EvaluationConfig(**values | config.evaluation, trained=config)


def trained_of(config: RobotConfig) -> RobotConfig:
    """The config of the scene for training."""
    return config.trained if isinstance(config, EvaluationConfig) else config


def mistakes_at(config: RobotConfig) -> At:
    """A function that makes the error for a key, which lies within `evaluation` if the value is from there."""
    trained = trained_of(config)

    def at(*key: str) -> Told:
        if config is not trained and key[0] in config.evaluation:
            return lambda what: mistake(config, key, what, ("evaluation",))
        return lambda what: mistake(trained, key, what)

    return at
