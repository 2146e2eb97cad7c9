import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from tltlrl.errors import UserError
from tltlrl.reports.plotting import LABELS, STYLES, curves_figure, faintness, plot_learning_curves, save, titled
from tltlrl.reports.sealed import read_curves


def curves(seeds=4, cases=tuple(LABELS)):
    rng = np.random.default_rng(0)
    return pd.DataFrame(
        {"task": "reach_avoid", "case": case, "seed": seed, "iteration": i, "episodes": 20 * (i + 1),
         "robustness_mean": -1 + 0.1 * i + rng.normal(), "robustness_policy": 0.1 * i}
        for case in cases for seed in range(seeds) for i in range(10)
    )  # fmt: skip


@pytest.mark.parametrize(("panels", "seeds"), [(1, 1), (2, 6)])  # with six there is a band, too
def test_figures_are_written_and_the_same_to_the_byte(tmp_path, panels, seeds):
    for name in ("a", "b"):
        plot_learning_curves({str(i): curves(seeds) for i in range(panels)}, tmp_path / name)
    for suffix in (".png", ".pdf"):
        assert (tmp_path / f"a{suffix}").stat().st_size > 1000
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_infinite_robustness_does_not_break_the_figure(tmp_path):
    frame = curves(cases=["tltl_episodic"])
    frame.loc[3, "robustness_mean"] = -np.inf
    plot_learning_curves({"a": frame}, tmp_path / "a")


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
        ("task,case,seed,iteration,episodes,robustness_mean,robustness_policy\n", "empty, or with an iteration twice"),
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
    plot_learning_curves({"a": curves(cases=["tltl_episodic"]), "b": curves()}, tmp_path / "a")
    (legend,) = figures[0].legends
    assert [text.get_text() for text in legend.get_texts()] == list(LABELS.values())


@pytest.mark.parametrize(("worst", "limits"), [(-1.1, []), (-1.3, [(-0.6, 0.23)])])
def test_a_second_panel_shows_what_is_near_zero_where_the_worst_curves_hide_it(tmp_path, monkeypatch, worst, limits):
    figures = []
    monkeypatch.setattr("tltlrl.reports.plotting.save", lambda figure, _: figures.append(figure))
    frame = curves(cases=["tltl_episodic", "discrete_step"])
    frame["robustness_mean"] = np.where(frame["case"] == "discrete_step", worst, 0.2)
    plot_learning_curves({"a": frame}, tmp_path / "a")
    shown = [axes.get_ylim() for axes in figures[0].axes[1:-1]]
    assert len(shown) == len(limits)
    np.testing.assert_allclose(shown, limits)


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """The figure of these experiments, before it is saved."""

    def draw(**experiments):
        figures = []
        monkeypatch.setattr("tltlrl.reports.plotting.save", lambda figure, _: figures.append(figure))
        plot_learning_curves(experiments, tmp_path / "a")
        return figures[0]

    return draw


def test_the_mean_policy_is_drawn(drawn):
    """A policy may satisfy the spec in every trial while none of its noisy samples does."""
    figure = drawn(a=curves(cases=["tltl_episodic"]))
    above, below = figure.axes
    assert (above.get_title(), below.get_title()) == ("a\nsampled trajectories", "mean policy, without noise")
    mean = next(line for line in below.get_lines() if line.get_label() == LABELS["tltl_episodic"])
    np.testing.assert_allclose(mean.get_ydata(), 0.1 * np.arange(10))


@pytest.mark.parametrize(
    ("seeds", "lines", "bands", "caption"),
    [
        (1, 1, 0, "1 seed; 20 sample trajectories per iteration."),
        (3, 4, 0, "Thick: mean of the seeds; thin: each seed."),
        (6, 7, 1, "Thick: mean of the seeds; thin: each seed; band: 95 % t interval of the mean."),
    ],
)
def test_what_is_drawn_of_so_many_seeds_and_what_is_said_of_it(drawn, seeds, lines, bands, caption):
    figure = drawn(a=curves(seeds, cases=["tltl_episodic"]))
    for axes in figure.axes:
        assert len(axes.get_lines()) == lines + 1  # and the line at 0
        assert len(axes.collections) == bands
        assert axes.get_ylabel() == "robustness\n(above 0: satisfied)"  # in whatever unit the spec's predicates have
    said = figure.get_supxlabel().splitlines()
    assert caption in said
    assert "Robustness of the spec, in the unit of its predicates, whatever the case was trained on." in said
    assert len(said) == (2 if seeds == 1 else 3)


def test_experiments_of_one_task_have_titles_that_differ(tmp_path):
    def titles(*paths):
        return list(titled([tmp_path / path for path in paths], [curves()] * len(paths)))

    assert titles("reach_avoid") == ["reach_avoid"]
    assert titles("reach_avoid", "mine") == ["reach_avoid", "reach_avoid: mine"]
    assert titles("a/x", "b/x") == [f"reach_avoid: {tmp_path}/a/x", f"reach_avoid: {tmp_path}/b/x"]


def test_curves_are_read_while_runs_go_on(tmp_path):
    """Of each run what it has written, but for a line that is not whole; a mean reaches as far as all of them do."""
    whole = curves(seeds=3, cases=["tltl_episodic"])
    for seed, rows in whole.groupby("seed"):
        folder = tmp_path / "tltl_episodic" / f"seed_{seed}"
        folder.mkdir(parents=True)
        text = rows.iloc[: [10, 4, 0][seed]].to_csv(index=False)
        (folder / "progress.csv").write_text({0: text, 1: text + "reach_avoid,tltl_epi", 2: ""}[seed])
    (tmp_path / "learning_curves.csv").write_text("of an earlier time")
    read, notes = read_curves(tmp_path)
    assert not notes
    assert read.groupby("seed")["iteration"].count().to_dict() == {0: 10, 1: 4}
    plot_learning_curves({"a": read}, tmp_path / "a")


def test_a_name_in_letters_that_the_font_lacks_is_drawn_without_a_word(tmp_path, recwarn):
    figure = Figure()
    figure.text(0.5, 0.5, "机器人")
    save(figure, tmp_path / "figure")
    assert not recwarn.list


def test_many_seeds_are_drawn_fainter_and_few_as_ever():
    assert [faintness(count) for count in (2, 4, 14)] == [1.0] * 3
    assert faintness(60) == pytest.approx(14 / 60)


def test_a_few_iterations_are_counted_whole():
    frame = curves()
    figure = curves_figure({"a": frame[frame["iteration"] < 3]})
    figure.draw_without_rendering()
    for axes in figure.axes:
        assert np.all(axes.get_xticks() % 1 == 0)
