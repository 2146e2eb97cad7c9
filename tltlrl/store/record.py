"""The files of one run, sealed with digests: what was damaged since is seen, and never read as if it were whole."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.store.files import read_arrays, write_arrays, write_json

PROGRESS, TIMING, POLICY, DONE, CHECKPOINT = (
    "progress.csv",
    "timing.csv",
    "policy.npz",
    "done.json",
    "checkpoint.npz",
)
SEAL, RUN = "sha256", "run"  # keys of done.json
UNREADABLE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


class DamagedError(ValueError):
    """A file of a run is not as it was written; the message says which."""


@dataclass(frozen=True)
class Checkpoint:
    """Where an unfinished run goes on.

    Attributes:
      iteration: iterations done.
      env_steps: samples in them.
      mean, covariance: the policy after them, shapes (T, d) and (T, d, d).
    """

    iteration: int
    env_steps: int
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits, as `sha256sum` prints it."""
    return hashlib.sha256(content).hexdigest()


def write_results(folder: Path, identity: str, policy: Policy, results: Mapping[str, Any]) -> None:
    """policy.npz and, last, done.json: the results and the seal of everything they belong to.

    Args:
      folder: of the run, with its whole progress.csv.
      identity: of the run; see `tltlrl.training.loop.Run.identity`.
      policy: the learned one.
      results: plain data.
    """
    write_arrays(
        folder / POLICY,
        gain=policy.gain,
        mean=policy.mean,
        covariance=policy.covariance,
        correlation=policy.correlation,
    )
    write_json(folder / DONE, {**results, SEAL: _seals(folder, identity, results)})
    (folder / CHECKPOINT).unlink(missing_ok=True)


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
    return {
        RUN: identity,
        DONE: digest(json.dumps(results, sort_keys=True).encode()),
        PROGRESS: digest((folder / PROGRESS).read_bytes()),
        POLICY: digest((folder / POLICY).read_bytes()),
    }


def read_policy(folder: Path) -> Policy:
    """policy.npz of a finished run.

    Raises:
      DamagedError: if it cannot be read.
    """
    try:
        saved = read_arrays(folder / POLICY)
        return Policy(saved["gain"], saved["mean"], saved["covariance"], float(saved["correlation"]))
    except UNREADABLE as error:
        raise DamagedError(f"{POLICY} cannot be read ({error})") from error


def write_checkpoint(folder: Path, identity: str, checkpoint: Checkpoint) -> None:
    """checkpoint.npz, sealed together with the rows of progress.csv so far, which must be in the file."""
    rows = (folder / PROGRESS).read_bytes()
    write_arrays(folder / CHECKPOINT, **vars(checkpoint), sha256=digest(identity.encode() + rows))


def read_checkpoint(folder: Path, identity: str) -> Checkpoint | None:
    """Where an unfinished run goes on; None if it starts from the beginning.

    Raises:
      DamagedError: if there is a checkpoint that cannot be gone on from.
    """
    if not (folder / CHECKPOINT).exists():
        return None
    try:
        saved = read_arrays(folder / CHECKPOINT)
        iteration = int(saved["iteration"])
        checkpoint = Checkpoint(iteration, int(saved["env_steps"]), saved["mean"], saved["covariance"])
        rows = first_rows(folder / PROGRESS, iteration)
        first_rows(folder / TIMING, iteration)
        if str(saved["sha256"]) != digest(identity.encode() + rows):
            raise ValueError(f"the rows of {PROGRESS} are not those it was written with")
    except UNREADABLE as error:
        raise DamagedError(f"{CHECKPOINT} cannot be gone on from ({error})") from error
    return checkpoint


def first_rows(path: Path, count: int) -> bytes:
    """The header and the first `count` rows of a CSV file.

    Raises:
      ValueError: if it has fewer.
    """
    lines = path.read_bytes().splitlines(keepends=True)
    if len(lines) <= count:
        raise ValueError(f"{path.name} has fewer rows")
    return b"".join(lines[: count + 1])
