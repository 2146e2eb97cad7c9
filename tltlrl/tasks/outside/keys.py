"""The settings of tasks that are environments of others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from tltlrl.settings import check, setting
from tltlrl.tasks.task import MOST_STEPS

MOST_SEED = 2**31 - 1


@dataclass(frozen=True)
class OutsideConfig:
    """The settings that all kinds of environments share."""

    name: str = setting("of the kind of environment", "")
    id: str = setting("of the environment", "")
    steps: int | None = setting(
        "samples of one episode; null: as many as the environment has", None, least=2, most=MOST_STEPS
    )
    control_timestep: float | None = setting(
        "time between two commands, s; null: as the environment says", None, above=0
    )
    start: int | None = setting(
        "seed of the start, the same for every trajectory; null: drawn anew for each", 0, least=0, most=MOST_SEED
    )
    command_noise: float = setting(
        "standard deviation of noise on the commands, as a share of a full command", 0.01, least=0, most=10
    )
    signals: dict[str, Any] = setting(
        "slices of the observations by names of your own, as {tip: 'observation[0:2]', speed: 'observation[2]'}; "
        "every observation is a signal by its own name, too",
        {},
    )
    feedback: dict[str, Any] = setting(
        "command: {feature: gain}, by the names that tltl tasks lists; added to the command per unit of that feature",
        {},
    )

    def __post_init__(self) -> None:
        check(self, "task")


@dataclass(frozen=True)
class GymnasiumConfig(OutsideConfig):
    """The settings of an environment of Gymnasium."""

    name: str = setting("of the kind of environment", "gymnasium")
    id: str = setting("as gymnasium.make takes it, such as Pendulum-v1", "")


@dataclass(frozen=True)
class SuiteConfig(OutsideConfig):
    """The settings of an environment of dm_control's suite."""

    name: str = setting("of the kind of environment", "suite")
    id: str = setting("domain and task, such as ball_in_cup-catch", "")
