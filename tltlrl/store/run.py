"""The files of one run, sealed with digests: what was damaged since is seen, and never read as if it were whole."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.store.files import digest, read_arrays, write_arrays, write_json
from tltlrl.store.layout import CALM, CHECKPOINT, DONE, POLICY, PROGRESS, TIMING

SEAL, RUN = "sha256", "run"  # keys of done.json
STATE = "state."  # before the names of the learner's arrays in checkpoint.npz
UNREADABLE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


class DamagedError(ValueError):
    """A file of a run is not as it was written; the message says which."""


@dataclass(frozen=True)
class Checkpoint:
    """Where an unfinished run is resumed.

    Attributes:
      iteration: iterations done.
      env_steps: samples in them.
      state: the learner's state after them, name => array.
    """

    iteration: int
    env_steps: int
    state: Mapping[str, NDArray[np.generic]]


def write_results(
    folder: Path,
    identity: str,
    policy: Mapping[str, NDArray[np.generic]],
    results: Mapping[str, Any],
    calm: Mapping[str, NDArray[np.generic]] | None = None,
) -> None:
    """policy.npz, calm.npz if there is one and, last, done.json: the results and the seal of everything they belong to.

    Args:
      folder: of the run, with its whole progress.csv.
      identity: of the run; see `tltlrl.training.study.Run.identity`.
      policy: the arrays of the learned one.
      results: plain data.
      calm: the arrays of the policy of the calm motion, if there is one.
    """
    write_arrays(folder / POLICY, **policy)
    (folder / CALM).unlink(missing_ok=True)
    if calm is not None:
        write_arrays(folder / CALM, **calm)
    write_json(folder / DONE, {**results, SEAL: _seals(folder, identity, results)})
    drop_checkpoint(folder)


def read_results(folder: Path, identity: str) -> dict[str, Any] | None:
    """What `write_results` was given; None if the run is not finished.

    Raises:
      DamagedError: if a file is missing, or is not as it was written, or belongs to another run.
    """
    try:
        text = (folder / DONE).read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except UNREADABLE as error:
        raise DamagedError(f"{DONE} cannot be read ({error})") from error
    try:
        results: dict[str, Any] = json.loads(text)
        seals = results.pop(SEAL)
        found = _seals(folder, identity, results)
        wrong = [name for name, value in found.items() if seals[name] != value]
    except FileNotFoundError as error:
        raise DamagedError(f"{Path(error.filename).name} is missing") from error
    except (*UNREADABLE, AttributeError) as error:
        raise DamagedError(f"{DONE} is not as it was written") from error
    if wrong:
        raise DamagedError(
            f"{DONE} is of another config, spec or seed" if wrong[0] == RUN else f"{wrong[0]} is not as it was written"
        )
    return results


def _seals(folder: Path, identity: str, results: Mapping[str, Any]) -> dict[str, str]:
    files = [PROGRESS, POLICY, *([CALM] if results.get("calm") else [])]
    return {
        RUN: identity,
        DONE: digest(json.dumps(results, sort_keys=True).encode()),
        **{name: digest((folder / name).read_bytes()) for name in files},
    }


def read_policy(folder: Path, name: str = POLICY) -> dict[str, NDArray[np.generic]]:
    """The arrays of a policy of a finished run, policy.npz or calm.npz.

    Raises:
      DamagedError: if it cannot be read.
    """
    try:
        return read_arrays(folder / name)
    except UNREADABLE as error:
        raise DamagedError(f"{name} cannot be read ({error})") from error


def write_checkpoint(folder: Path, identity: str, checkpoint: Checkpoint) -> None:
    """checkpoint.npz, sealed together with the rows of progress.csv so far, which must be in the file."""
    rows = (folder / PROGRESS).read_bytes()
    state = {f"{STATE}{name}": array for name, array in checkpoint.state.items()}
    write_arrays(
        folder / CHECKPOINT,
        iteration=checkpoint.iteration,
        env_steps=checkpoint.env_steps,
        sha256=digest(identity.encode() + rows),
        **state,
    )


def read_checkpoint(folder: Path, identity: str) -> Checkpoint | None:
    """Where an unfinished run is resumed; None if it starts from the beginning.

    Raises:
      DamagedError: if there is a checkpoint that a run cannot be resumed from.
    """
    if not (folder / CHECKPOINT).exists():
        return None
    try:
        saved = read_arrays(folder / CHECKPOINT)
        iteration = int(saved["iteration"])
        state = {name.removeprefix(STATE): array for name, array in saved.items() if name.startswith(STATE)}
        rows = first_rows(folder / PROGRESS, iteration)
        first_rows(folder / TIMING, iteration)
        if not state or str(saved["sha256"]) != digest(identity.encode() + rows):
            raise ValueError(f"the rows of {PROGRESS} are not those it was written with")
        return Checkpoint(iteration, int(saved["env_steps"]), state)
    except UNREADABLE as error:
        raise DamagedError(f"a run cannot be resumed from its {CHECKPOINT} ({error})") from error


def drop_checkpoint(folder: Path) -> None:
    """Deletes checkpoint.npz, if there is one."""
    (folder / CHECKPOINT).unlink(missing_ok=True)


def first_rows(path: Path, count: int) -> bytes:
    """The header and the first `count` rows of a CSV file.

    Raises:
      ValueError: if it has fewer.
    """
    lines = path.read_bytes().splitlines(keepends=True)
    if len(lines) <= count:
        raise ValueError(f"{path.name} has fewer rows")
    return b"".join(lines[: count + 1])
