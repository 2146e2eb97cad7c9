"""The lock of a folder: what it says when it cannot be had, and that it changes nothing that is not ours."""

import errno
import fcntl

import pytest

from tltlrl.errors import UserError
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
