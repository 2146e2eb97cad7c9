"""Writes files that are either whole or not there: under a temporary name first, then renamed."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import os
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

TEMPORARY = ".part"
MOST_ARRAYS = 4 * 2**30  # bytes
LEFTOVER = re.compile(rf"\..+\.\d+{re.escape(TEMPORARY)}")


def write_bytes(path: Path, content: bytes) -> None:
    """Writes `content` to `path`. A reader sees the old file or the new one, never a part of either.

    Raises:
      OSError: if it cannot be written; it names `path`.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}{TEMPORARY}")
    try:
        with open(temporary, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        with contextlib.suppress(OSError):  # it is gone already, or the disk has become read-only
            temporary.unlink()


@contextlib.contextmanager
def naming(path: Path) -> Iterator[None]:
    """Adds `path` to an error of the file system that names no file, such as the one of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        raise OSError(error.errno, error.strerror, str(path)) from error


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal digits, as `sha256sum` prints it."""
    return hashlib.sha256(content).hexdigest()


def digest_of_digests(files: Iterable[tuple[str, Path]]) -> str:
    """SHA-256, in hexadecimal digits, of labels and of the SHA-256 of the files that they stand for, in this order."""
    return digest(b"".join(label.encode() + bytes.fromhex(digest(path.read_bytes())) for label, path in files))


def clear_leftovers(folder: Path) -> None:
    """Deletes temporary files in `folder` that a process left when it was killed while it wrote them."""
    for path in folder.glob(f".*{TEMPORARY}"):
        if LEFTOVER.fullmatch(path.name) and path.is_file() and not path.is_symlink():
            path.unlink(missing_ok=True)


def write_text(path: Path, content: str) -> None:
    """Writes text in UTF-8, as `write_bytes` does."""
    write_bytes(path, content.encode())


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Writes indented JSON, as `write_bytes` does."""
    write_text(path, json.dumps(content, indent=2) + "\n")


def write_arrays(path: Path, **arrays: Any) -> None:
    """Writes an .npz archive, as `write_bytes` does; its bytes depend on the arrays alone."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of an .npz archive, name => array; it never unpickles."""
    return arrays_in(path.read_bytes())


def arrays_in(content: bytes) -> dict[str, np.ndarray]:
    """The arrays in the bytes of an .npz archive, name => array.

    Raises:
      ValueError: if they would take more than `MOST_ARRAYS` bytes, as in a forged archive that unfolds.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        if sum(part.file_size for part in packed.infolist()) > MOST_ARRAYS:
            raise ValueError(f"its arrays take more than {MOST_ARRAYS // 2**30} GB")
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
