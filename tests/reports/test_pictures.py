"""Pictures: the same whatever a user's matplotlibrc says, and known by what they show."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from tltlrl.logic import parse_spec
from tltlrl.reports.plotting import curves_figure, own_style, picture, save, shows
from tltlrl.reports.trace import draw


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


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_nor_the_picture_of_a_trace(tmp_path, suffix):
    spec = parse_spec("signal x\nspec: G (x < 2)\n")
    signals = {"x": np.array([[0.0, 1.0]])}
    (why,) = spec.explain(signals)
    draw(spec, signals, why, tmp_path / f"a{suffix}")
    with mpl.rc_context({"axes.facecolor": "red", "font.size": 30, "savefig.facecolor": "red", "svg.hashsalt": "b"}):
        draw(spec, signals, why, tmp_path / f"b{suffix}")
    assert (tmp_path / f"b{suffix}").read_bytes() == (tmp_path / f"a{suffix}").read_bytes()


def test_nor_one_that_is_shown_in_a_notebook():
    curves = {
        "task": ["t"] * 2,
        "case": ["tltl_episodic"] * 2,
        "seed": [0, 0],
        "iteration": [1, 2],
        "episodes": [5] * 2,
    }
    figures = pd.DataFrame(curves | {"robustness_mean": [0.1, 0.2], "robustness_policy": [0.1, 0.2]})
    plain = picture(curves_figure({"t": figures}), ".png", 50)
    with mpl.rc_context({"axes.facecolor": "red", "savefig.facecolor": "red", "figure.dpi": 30, "font.size": 30}):
        assert picture(curves_figure({"t": figures}), ".png", 50) == plain
