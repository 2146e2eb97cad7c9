"""As a package of someone else's: the task `short_arm` and the learner `careful`; its task `broken` has no module."""

from dataclasses import dataclass
from typing import ClassVar

from tltlrl.learning.reps import EpisodeBased, RepsSettings
from tltlrl.settings import check, setting
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig
from tltlrl.tasks.task import TaskEntry


@dataclass(frozen=True)
class ShortArmConfig(PlanarArmConfig):
    name: str = setting("of the task", "short_arm")
    steps: int = setting("samples of one episode", 12, least=2)


@dataclass(frozen=True)
class CarefulSettings:
    caution: float = setting("how much less it trusts its samples, as a share", 0.5, least=0, below=1)

    def __post_init__(self) -> None:
        check(self, "algorithm")


class Careful(EpisodeBased):
    Settings: ClassVar[type] = CarefulSettings

    def __init__(self, settings, samples):
        super().__init__(RepsSettings(epsilon=1 - settings.caution), samples)


SHORT_ARM = TaskEntry(config=ShortArmConfig, make=PlanarArm)
