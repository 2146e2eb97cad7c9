"""Pictures: the same whatever a user's matplotlibrc says, and known by what they show."""

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from tltlrl.reports.plotting import own_style, save, shows


def drawn(path, source=""):
    with own_style():
        figure = Figure(figsize=(1, 1))
        figure.add_subplot().plot([1, 2])
        save(figure, path, source)
    return path.with_suffix(".png").read_bytes()


def test_a_users_matplotlibrc_changes_no_figure(tmp_path):
    plain = drawn(tmp_path / "a")
    with mpl.rc_context({"axes.facecolor": "red", "font.size": 30, "lines.linewidth": 9}):
        assert drawn(tmp_path / "b") == plain
        assert mpl.rcParams["font.size"] == 30


def cut(path):
    path.write_bytes(path.read_bytes()[:-10])


def deleted(path):
    path.unlink()


@pytest.mark.parametrize("suffix", [".png", ".pdf"])
@pytest.mark.parametrize("damage", [cut, deleted])
def test_a_picture_is_known_by_its_source_and_by_being_whole(tmp_path, suffix, damage):
    drawn(tmp_path / "a", "0f" * 32)
    assert shows(tmp_path / "a", "0f" * 32)
    assert not shows(tmp_path / "a", "0e" * 32)
    damage(tmp_path / f"a{suffix}")
    assert not shows(tmp_path / "a", "0f" * 32)
