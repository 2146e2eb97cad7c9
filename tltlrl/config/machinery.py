"""How and where a study is computed: nothing here changes the results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from tltlrl.errors import UserError
from tltlrl.resources import user_path
from tltlrl.settings import Role, check_value, setting, settings_of


@dataclass(frozen=True)
class Engine:
    """The section `engine`."""

    address: str | None = setting("a Dask scheduler, for instance tcp://127.0.0.1:8786; null for this machine", None)


@dataclass(frozen=True)
class Machinery:
    """How and where a study is computed.

    Attributes:
      workers: processes; None for one per processor.
      address: address of a Dask scheduler; None for this machine.
      runs_dir: the folder above those of the experiments.
      overwrite: whether to delete an older folder of the same name first.
    """

    workers: int | None = setting(
        "processes; null for one per processor, at most one per run", None, least=1, role=Role.MACHINERY | Role.BUDGET
    )
    address: str | None = None
    runs_dir: str = setting("the folder above the experiments' folders", "runs", role=Role.MACHINERY | Role.NAMES)
    overwrite: bool = setting("delete an existing folder of that name first", False, role=Role.MACHINERY | Role.BUDGET)

    def __post_init__(self) -> None:
        check_value("workers", self.workers, settings_of(Machinery)["workers"])
        if not self.runs_dir.strip():
            raise UserError("runs_dir: it is empty; give the folder above the experiments' folders, or . for this one")

    def folder(self, name: str) -> Path:
        """The folder for the results of a study with this name."""
        return user_path(self.runs_dir) / name
