"""Where the configs and specs lie: inside the package in a wheel, beside it in a checkout."""

from __future__ import annotations

from pathlib import Path

from tltlrl.errors import UserError, nearest

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


CONFIGS = _folder("configs")
SPECS = _folder("specs")


def spec_path(name: str) -> Path:
    """A spec file: the user's own if `name` is a path to one, otherwise the one of that name shipped with tltlrl.

    Raises:
      UserError: if there is neither.
    """
    for path in (Path(name), SPECS / name, SPECS / f"{name}.tltl"):
        if path.is_file():
            return path
    raise UserError(
        f"no spec file {name} here or in {SPECS}{nearest(name, (path.name for path in SPECS.glob('*.tltl')))}"
    )
