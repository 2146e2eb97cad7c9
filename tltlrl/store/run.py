"""The files of one run, sealed with digests. A file that was damaged later is noticed and not used."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tltlrl.store.bounded import read_json
from tltlrl.store.files import digest, read_arrays, write_arrays, write_json
from tltlrl.store.layout import (
    CALM,
    CALM_CHECKPOINT,
    CHECKPOINT,
    CLAUSES,
    DONE,
    LAST,
    POLICY,
    PROGRESS,
    TIMING,
    run_of,
)

SEAL, RUN = "sha256", "run"  # keys of done.json
STATE = "state."  # prefix of the arrays of `Checkpoint.state` in checkpoint.npz
UNREADABLE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


class DamagedError(ValueError):
    """A file of a run is not as it was written; the message says which."""


@dataclass(frozen=True)
class Checkpoint:
    """Where an unfinished run is resumed.

    Attributes:
      iteration: iterations done.
      env_steps: samples in them.
      state: the learner's state after them, and the best policy so far, name => array.
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
    """Writes policy.npz, calm.npz and, last, done.json: the results and the seal of the run's files.

    Args:
      folder: folder of the run, with the complete progress.csv.
      identity: of the run; see `tltlrl.training.study.Run.identity`.
      policy: the arrays of the learned one.
      results: the results as plain data, for done.json.
      calm: the arrays of its calm policy, if it has one.
    """
    write_arrays(folder / POLICY, **policy)
    if calm is None:
        (folder / CALM).unlink(missing_ok=True)
    else:
        write_arrays(folder / CALM, **calm)
    write_json(folder / DONE, {**results, SEAL: _seals(folder, identity, results, True)})
    shelve_checkpoint(folder)


def read_results(folder: Path, identity: str | None = None) -> dict[str, Any] | None:
    """What `write_results` was given; None if the run is not finished.

    Args:
      folder: of the run.
      identity: of the run; None accepts the results of any run.

    Raises:
      DamagedError: if a file is missing, or is not as it was written, or belongs to another run.
    """
    try:
        content = read_json(folder / DONE)
    except FileNotFoundError:
        return None
    except json.JSONDecodeError as error:
        raise DamagedError(f"{DONE} is not as it was written") from error
    except UNREADABLE as error:
        raise DamagedError(f"{DONE} cannot be read ({error})") from error
    try:
        results: dict[str, Any] = dict(content)
        seals = results.pop(SEAL)
        found = _seals(folder, seals[RUN] if identity is None else identity, results, CLAUSES in seals)
        wrong = [name for name, value in found.items() if seals[name] != value]
    except FileNotFoundError as error:
        raise DamagedError(f"{Path(error.filename).name} is missing") from error
    except (*UNREADABLE, AttributeError) as error:
        raise DamagedError(f"{DONE} is not as it was written") from error
    if wrong:
        raise DamagedError(
            f"{DONE} is of another config, spec, seed or version of tltlrl"
            if wrong[0] == RUN
            else f"{wrong[0]} is not as it was written"
        )
    return results


def _seals(folder: Path, identity: str, results: Mapping[str, Any], has_clauses: bool) -> dict[str, str]:
    # Versions before 0.3 wrote no clauses.csv.
    return {
        RUN: identity,
        DONE: digest(json.dumps(results, sort_keys=True).encode()),
        PROGRESS: digest((folder / PROGRESS).read_bytes()),
        **({CLAUSES: digest((folder / CLAUSES).read_bytes())} if has_clauses else {}),
        POLICY: digest((folder / POLICY).read_bytes()),
        **({CALM: digest((folder / CALM).read_bytes())} if results.get("calm") else {}),
    }


def read_policy(folder: Path, name: str = POLICY) -> dict[str, NDArray[np.generic]]:
    """The arrays of policy.npz, or of calm.npz, of a finished run.

    Raises:
      DamagedError: if it cannot be read.
    """
    try:
        return read_arrays(folder / name)
    except UNREADABLE as error:
        raise DamagedError(f"{name} cannot be read ({error})") from error


def write_calm_checkpoint(folder: Path, identity: str, state: Mapping[str, NDArray[np.generic]]) -> None:
    """Writes calm_checkpoint.npz: how far the motion of a learned policy is simplified.

    Args:
      folder: of the run.
      identity: of the run and of the learned policy.
      state: name => array.
    """
    write_arrays(folder / CALM_CHECKPOINT, sha256=_seal_of_arrays(identity, state), **state)


def read_calm_checkpoint(folder: Path, identity: str) -> dict[str, NDArray[np.generic]] | None:
    """What `write_calm_checkpoint` was given; None if there is nothing of this run and policy that can be read."""
    try:
        saved = read_arrays(folder / CALM_CHECKPOINT)
        return saved if str(saved.pop("sha256")) == _seal_of_arrays(identity, saved) else None
    except UNREADABLE:  # then it begins again, and ends in the same motion
        return None


def write_checkpoint(folder: Path, identity: str, checkpoint: Checkpoint) -> None:
    """Writes checkpoint.npz, sealed with the rows of progress.csv and clauses.csv, which must be written before."""
    rows = b"".join(first_rows(folder / name, checkpoint.iteration) for name in (PROGRESS, CLAUSES))
    content: dict[str, Any] = {f"{STATE}{name}": array for name, array in checkpoint.state.items()}
    content |= {"iteration": checkpoint.iteration, "env_steps": checkpoint.env_steps}
    write_arrays(folder / CHECKPOINT, sha256=_seal_of_arrays(identity, content, rows), **content)


def read_checkpoint(folder: Path, identity: str, name: str = CHECKPOINT) -> Checkpoint | None:
    """Where a run is resumed; None if it starts from the beginning.

    Args:
      folder, identity: of the run.
      name: of the file. `LAST` is the state that a finished run goes on from when it is given more iterations.

    Raises:
      DamagedError: if there is a checkpoint that a run cannot be resumed from.
    """
    if not (folder / name).exists():
        return None
    try:
        saved = read_arrays(folder / name)
        iteration = int(saved["iteration"])
        state = {name.removeprefix(STATE): array for name, array in saved.items() if name.startswith(STATE)}
        rows = b"".join(first_rows(folder / name, iteration) for name in (PROGRESS, CLAUSES))
        first_rows(folder / TIMING, iteration)
        if not state or str(saved.pop("sha256")) != _seal_of_arrays(identity, saved, rows):
            raise ValueError(f"it, or a row of {PROGRESS} or {CLAUSES}, is not as it was written")
        return Checkpoint(iteration, int(saved["env_steps"]), state)
    except UNREADABLE as error:
        raise DamagedError(f"a run cannot be resumed from its {name} ({error})") from error


def _seal_of_arrays(identity: str, arrays: Mapping[str, ArrayLike], rows: bytes = b"") -> str:
    """The seal of a run's state, on which all later results depend."""
    content = [identity.encode(), rows]
    for name, values in sorted(arrays.items()):
        array = np.asarray(values)
        content += [f"{name} {array.dtype.str} {array.shape}".encode(), array.tobytes()]
    return digest(b"".join(content))


def shelve_checkpoint(folder: Path) -> None:
    """Renames the last checkpoint of a finished run, which needs it if it is given more iterations."""
    if (folder / CHECKPOINT).exists():
        (folder / CHECKPOINT).replace(folder / LAST)
    (folder / CALM_CHECKPOINT).unlink(missing_ok=True)


def iterations_done(folder: Path) -> int | None:
    """The iterations of a finished run; None if it is not finished, or done.json cannot be read."""
    try:
        return int(read_json(folder / DONE)["iterations"])
    except UNREADABLE:
        return None


def drop_checkpoint(folder: Path) -> None:
    """Deletes the checkpoints, if there are any."""
    (folder / CHECKPOINT).unlink(missing_ok=True)
    (folder / CALM_CHECKPOINT).unlink(missing_ok=True)


def first_rows(path: Path, count: int) -> bytes:
    """The header and the first `count` rows of a CSV file.

    Raises:
      ValueError: if it has fewer.
    """
    lines = path.read_bytes().splitlines(keepends=True)
    if len(lines) <= count:
        raise ValueError(f"{path.name} has fewer rows")
    return b"".join(lines[: count + 1])


def begun(folder: Path) -> list[Path]:
    """The folders of all runs of an experiment that have written something, by case and seed."""
    found = {path.parent for name in (PROGRESS, DONE) for path in folder.glob(f"*/seed_*/{name}")}
    return sorted((run for run in found if run.name.removeprefix("seed_").isdecimal()), key=run_of)


def sealed_run(folder: Path) -> tuple[dict[str, Any], str]:
    """The results and the progress.csv of a finished run of any config; the folder says its case and seed.

    Raises:
      DamagedError: if a file is missing or not as it was written.
    """
    results = read_results(folder)
    if results is None:
        raise DamagedError(f"{DONE} is missing")
    text = (folder / PROGRESS).read_text(encoding="utf-8")
    first = next(csv.DictReader(io.StringIO(text)), {})
    if (first.get("case"), first.get("seed")) != (run_of(folder)[0], str(run_of(folder)[1])):
        raise DamagedError(f"{PROGRESS} is of another case or seed")
    return results, text


def robustness_so_far(folder: Path) -> float | None:
    """The robustness of the mean policy in the last row that a run wrote; None without a row."""
    try:
        rows = list(csv.DictReader(io.StringIO(whole_lines(folder / PROGRESS))))
        return float(rows[-1]["robustness_policy"])
    except (OSError, ValueError, KeyError, IndexError):
        return None


def whole_lines(path: Path) -> str:
    """The text of a CSV file that another process may be writing, without an incomplete last line."""
    text, end, _ = path.read_text(encoding="utf-8").rpartition("\n")
    return text + end


def joined(tables: Sequence[str]) -> str:
    """Joins CSV texts into one. A column that a text lacks, such as another learner's, is empty in its rows."""
    rows = [row for table in tables for row in csv.DictReader(io.StringIO(table))]
    columns = dict.fromkeys(name for table in tables for name in table.split("\n", 1)[0].split(","))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
