import numpy as np
import pandas as pd
import pytest

from tltlrl.errors import UserError
from tltlrl.reports.plotting import LABELS, STYLES, bootstrap_band, plot_learning_curves, read_curves


def curves(seeds=4, cases=tuple(LABELS)):
    rng = np.random.default_rng(0)
    return pd.DataFrame(
        {"task": "reach_avoid", "case": case, "seed": seed, "iteration": i, "episodes": 20 * (i + 1),
         "robustness_mean": -1 + 0.1 * i + rng.normal()}
        for case in cases for seed in range(seeds) for i in range(10)
    )  # fmt: skip


def test_bootstrap_band_is_that_of_the_mean():
    """With two values a and b the resampled mean is a, (a + b) / 2 or b: the 95 % band is from a to b."""
    low, high = bootstrap_band(np.array([[0.0, 1.0], [5.0, 5.0]]))
    np.testing.assert_allclose([low, high], [[0.0, 5.0], [1.0, 5.0]])


def test_bootstrap_band_is_near_the_normal_interval_for_many_seeds():
    values = np.random.default_rng(1).normal(size=(1, 400))
    low, high = bootstrap_band(values)
    half = 1.96 * values.std() / 20
    np.testing.assert_allclose([low[0], high[0]], [values.mean() - half, values.mean() + half], atol=0.015)


def test_the_band_does_not_depend_on_how_much_is_drawn_at_a_time(monkeypatch):
    values = np.random.default_rng(2).normal(size=(50, 7))
    whole = bootstrap_band(values)
    for batch in (1, 350 * 3, 350 * 1024):
        monkeypatch.setattr("tltlrl.reports.plotting.BATCH", batch)
        np.testing.assert_array_equal(bootstrap_band(values), whole)


@pytest.mark.parametrize("seeds", [1, 2, 4])
@pytest.mark.parametrize("panels", [1, 2])
def test_figures_are_written_and_the_same_to_the_byte(tmp_path, seeds, panels):
    for name in ("a", "b"):
        plot_learning_curves([curves(seeds)] * panels, tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.pdf").stat().st_size > 1000


def test_infinite_robustness_does_not_break_the_figure(tmp_path):
    frame = curves()
    frame.loc[3, "robustness_mean"] = -np.inf
    plot_learning_curves([frame], tmp_path / "a")


def test_every_case_has_a_style_and_no_two_share_colour_or_dash():
    assert STYLES.keys() == LABELS.keys()
    assert len({str(style["linestyle"]) for style in STYLES.values()}) == len(STYLES)
    assert len({style["color"] for style in STYLES.values()}) == len(STYLES)


def test_colours_are_told_apart_in_grey():
    """Luminance differs by at least 5 % between any two cases; the dashes do the rest."""
    grey = sorted(
        np.dot([int(style["color"][i : i + 2], 16) / 255 for i in (1, 3, 5)], [0.299, 0.587, 0.114])
        for style in STYLES.values()
    )
    assert min(np.diff(grey)) > 0.05


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "cannot be read"),
        ("", "cannot be read"),
        ("task,case\n", "no column episodes, iteration"),
        ("task,case,seed,iteration,episodes,robustness_mean\n", "empty, or with an iteration twice"),
    ],
)
def test_a_folder_without_curves_is_told(tmp_path, content, message):
    if content is not None:
        (tmp_path / "learning_curves.csv").write_text(content)
    with pytest.raises(UserError, match=message):
        read_curves(tmp_path)


def test_every_case_of_every_panel_is_in_the_legend(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr("tltlrl.reports.plotting.save", lambda figure, _: figures.append(figure))
    plot_learning_curves([curves(cases=["tltl_episodic"]), curves()], tmp_path / "a")
    (legend,) = figures[0].legends
    assert [text.get_text() for text in legend.get_texts()] == list(LABELS.values())


@pytest.mark.parametrize(("worst", "limits"), [(-1.1, []), (-1.3, [(-0.6, 0.23)])])
def test_a_second_panel_shows_what_is_near_zero_where_the_worst_curves_hide_it(tmp_path, monkeypatch, worst, limits):
    figures = []
    monkeypatch.setattr("tltlrl.reports.plotting.save", lambda figure, _: figures.append(figure))
    frame = curves(cases=["tltl_episodic", "discrete_step"])
    frame["robustness_mean"] = np.where(frame["case"] == "discrete_step", worst, 0.2)
    plot_learning_curves([frame], tmp_path / "a")
    shown = [axes.get_ylim() for axes in figures[0].axes[1:]]
    assert len(shown) == len(limits)
    np.testing.assert_allclose(shown, limits)
