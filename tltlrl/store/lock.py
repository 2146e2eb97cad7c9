"""The lock of a folder that is written to, of a run or of an experiment.

The lock is on a file in the folder, not on the folder itself: on a network file system, other hosts see only locks of
files. The lock ends with the process that holds it, however that process ends.
"""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from tltlrl.errors import UserError
from tltlrl.store.layout import LOCK

RETRY_SECONDS = 0.05

if sys.platform == "win32":
    import msvcrt

    BEYOND_THE_NUMBER = 1024  # where the lock is: others cannot read a locked byte

    def _lock(descriptor: int) -> None:
        os.lseek(descriptor, BEYOND_THE_NUMBER, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _lock(descriptor: int) -> None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


class BusyError(UserError):
    """Another process holds the folder.

    Attributes:
      holder: its number, or "unknown".
    """

    def __init__(self, folder: Path, holder: str) -> None:
        super().__init__(f"process {holder} is working in {folder}")
        self.holder = holder


@contextlib.contextmanager
def held(folder: Path, patience: float = 0.0) -> Iterator[None]:
    """Locks a folder for this process; makes the folder if there is none.

    Args:
      folder: whose `.lock` is locked; a link in its place is not followed.
      patience: seconds to wait for another process to end.

    Raises:
      BusyError: if another process holds it for longer.
      UserError: if the folder cannot be written, or its file system has no locks, or its `.lock` is another program's.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    except OSError as error:
        raise UserError(f"{folder} cannot be written ({error.strerror}); set another runs_dir=...") from error
    try:
        _check_ours(folder, descriptor)
        _wait(folder, descriptor, time.monotonic() + patience)
        os.ftruncate(descriptor, 0)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.write(descriptor, f"{os.getpid()}\n".encode())
        yield
    finally:
        os.close(descriptor)


def _check_ours(folder: Path, descriptor: int) -> None:
    """Checks that the lock is empty or holds a number, as ours do: another program's file must stay as it is."""
    content = _content(descriptor)
    if content and not content.strip().isdigit():
        raise UserError(f"{folder}/{LOCK} is not one of tltlrl's; set another name=... or runs_dir=...")


def _content(descriptor: int) -> bytes:
    os.lseek(descriptor, 0, os.SEEK_SET)
    return os.read(descriptor, 32)


def _wait(folder: Path, descriptor: int, deadline: float) -> None:
    while True:
        try:
            _lock(descriptor)
            return
        except (BlockingIOError, PermissionError) as error:  # Windows raises PermissionError
            if time.monotonic() >= deadline:
                holder = _content(descriptor).decode("ascii", errors="replace").strip()
                raise BusyError(folder, holder if holder.isdecimal() else "unknown") from error
            time.sleep(RETRY_SECONDS)
        except OSError as error:
            raise UserError(
                f"{folder}: files cannot be locked there ({error.strerror}); set runs_dir=... to a file system that "
                "has locks (flock)"
            ) from error
