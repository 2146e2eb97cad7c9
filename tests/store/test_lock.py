"""The lock of a folder: what it says when it cannot be had, and that it changes nothing that is not ours."""

import errno
import fcntl
import importlib.util
import os
import struct
import sys
import types

import pytest

from tltlrl.errors import UserError
from tltlrl.store import lock
from tltlrl.store.files import clear_leftovers
from tltlrl.store.lock import held


@pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EIO])
def test_a_file_system_without_locks_is_told_as_that(tmp_path, monkeypatch, number):
    def refuse(*_):
        raise OSError(number, "it cannot")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with (
        pytest.raises(UserError, match=r"files cannot be locked there \(it cannot\); set runs_dir=\.\.\."),
        held(tmp_path),
    ):
        pass


def test_somebody_elses_lock_is_not_written_to(tmp_path):
    (tmp_path / ".lock").write_text("my own notes")
    with pytest.raises(UserError, match=r"\.lock is not one of tltlrl's"), held(tmp_path):
        pass
    assert (tmp_path / ".lock").read_text() == "my own notes"


def test_a_link_in_place_of_the_lock_is_not_followed(tmp_path):
    (tmp_path / "precious").write_text("123")
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder/.lock").symlink_to(tmp_path / "precious")
    with pytest.raises(UserError, match="cannot be written"), held(tmp_path / "folder"):
        pass
    assert (tmp_path / "precious").read_text() == "123"


def test_only_leftovers_of_ours_are_deleted(tmp_path):
    for name in (".done.json.17.part", ".film.part", ".x.y.part"):
        (tmp_path / name).write_text("")
    (tmp_path / ".a.1.part").symlink_to(tmp_path / ".film.part")
    clear_leftovers(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".a.1.part", ".film.part", ".x.y.part"]


@pytest.fixture
def on_windows(monkeypatch):
    """The module as it is loaded there, over locks of single bytes, which are all that msvcrt has."""

    def locking(descriptor, _mode, length):
        try:  # of the open file, as there: a second one of the same process is refused, too
            fcntl.fcntl(descriptor, fcntl.F_OFD_SETLK, struct.pack("hhqqi", fcntl.F_WRLCK, os.SEEK_CUR, 0, length, 0))
        except BlockingIOError as error:
            raise PermissionError(errno.EACCES, "Permission denied") from error

    monkeypatch.setitem(sys.modules, "msvcrt", types.SimpleNamespace(locking=locking, LK_NBLCK=2))
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.delattr(os, "O_NOFOLLOW")
    spec = importlib.util.spec_from_file_location("lock_on_windows", lock.__file__)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_windows_has_the_same_lock(on_windows, tmp_path):
    with (
        on_windows.held(tmp_path),
        pytest.raises(on_windows.BusyError, match=f"process {os.getpid()} is working in"),
        on_windows.held(tmp_path),
    ):
        pass
    with on_windows.held(tmp_path):
        assert (tmp_path / ".lock").read_text() == f"{os.getpid()}\n"
