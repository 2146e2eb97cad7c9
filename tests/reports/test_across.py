"""Experiments against each other, and cases over several tasks."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import trim_mean

from tltlrl.cli.plot import names_of
from tltlrl.reports.across import cases_figure, differences, never_satisfied, over_tasks


def summary(task, values, case="tltl_episodic", success=1.0):
    return pd.DataFrame(
        {"task": task, "case": case, "seed": range(len(values)), "robustness_policy": values,
         "robustness_mean_over_run": values, "success_rate": success}
    )  # fmt: skip


def test_a_difference_is_paired_over_common_seeds_and_says_who_is_better():
    seeds = np.arange(10.0)
    rows = differences({"a": summary("t", seeds), "b": summary("t", seeds[:8] + 0.5 + 0.01 * seeds[:8] ** 2)})
    assert [row.seeds for row in rows] == [8, 8]
    row = rows[0]
    assert row.low < row.mean < row.high < 0
    assert row.mean == pytest.approx(-0.5 - 0.01 * np.mean(seeds[:8] ** 2))
    assert row.p == pytest.approx(2 / 2**8)
    assert str(row).endswith("8 seeds: b is better")


def test_of_few_seeds_there_is_no_interval_and_nothing_is_told_apart():
    (row, _) = differences({"a": summary("t", [1.0, 2.0, 3.0]), "b": summary("t", [0.0, 0.5, 1.0])})
    assert np.isnan(row.low)
    assert str(row).endswith("a - b +1.500, p 0.25, 3 seeds: not told apart")


def test_several_tasks_are_taken_together_by_the_interquartile_mean():
    rng = np.random.default_rng(1)
    scores = [rng.uniform(0, 1, 8), rng.uniform(0.5, 1, 8)]
    tables = [summary(f"t{i}", own, success=own) for i, own in enumerate(scores)]
    assert over_tasks(tables[:1]) == []
    found, shares = over_tasks([*tables, summary("t0", [1.0, 2.0], case="discrete_step")])
    assert (found.case, found.score, found.tasks, found.runs) == ("tltl_episodic", "success_rate", 2, 16)
    assert found.mean == pytest.approx(trim_mean(np.concatenate(scores), 0.25))
    assert found.low < found.mean < found.high
    assert shares.score == "robustness_share"
    assert shares.mean == pytest.approx(trim_mean(np.concatenate([scores[0] / 2, scores[1] / scores[1].max()]), 0.25))
    assert found == over_tasks(tables)[0]
    assert differences({"a": tables[0], "b": tables[1]}) == []


def test_no_unit_of_a_spec_weighs_and_a_task_that_nobody_satisfies_has_no_share():
    metres, seconds = summary("t0", [0.1, 0.2, -0.3]), summary("t1", [0.01, 0.02, -0.03])
    (_, share) = over_tasks([metres, seconds])
    assert share.mean == pytest.approx(trim_mean([0.5, 1.0, -1.5] * 2, 0.25))
    for factor in (1e-3, 1e3):
        scaled = seconds.assign(robustness_policy=factor * seconds["robustness_policy"])
        assert over_tasks([metres, scaled])[1].mean == pytest.approx(share.mean)
    failed = summary("t1", [-1.0, -2.0])
    assert [row.score for row in over_tasks([metres, failed])] == ["success_rate"]
    assert (never_satisfied([metres, failed]), never_satisfied([metres, seconds])) == (["t1"], [])


def test_an_experiment_is_called_by_the_keys_that_differ(tmp_path):
    folders = [tmp_path / name for name in ("x", "y")]
    for folder, epsilon in zip(folders, (0.2, 0.5), strict=True):
        folder.mkdir()
        (folder / "config.yaml").write_text(f"name: {folder.name}\nseeds: 3\nalgorithm:\n  epsilon: {epsilon}\n")
    assert names_of(folders) == ["algorithm.epsilon=0.2", "algorithm.epsilon=0.5"]
    (folders[1] / "config.yaml").write_text("name: y\nalgorithm:\n  epsilon: 0.2\n")
    assert names_of(folders) == ["x", "y"]


def test_every_common_case_has_a_row_and_every_experiment_a_line_of_its_own():
    curves = pd.DataFrame(
        {"task": "t", "case": case, "seed": seed, "iteration": i, "episodes": 20, "robustness_mean": float(i),
         "robustness_policy": float(i)}
        for case in ("tltl_episodic", "discrete_step") for seed in range(2) for i in range(4)
    )  # fmt: skip
    figure = cases_figure({"epsilon=1": curves, "epsilon=2": curves[curves["case"] == "tltl_episodic"]})
    labels = [axes.get_legend_handles_labels()[1] for axes in figure.axes]
    assert labels == [["epsilon=1", "epsilon=2"]] * 2  # the other case is in one experiment alone
    lines = [line for line in figure.axes[0].get_lines() if not line.get_label().startswith("_")]
    assert len({str(line.get_linestyle()) for line in lines}) == 2
    both = cases_figure({"epsilon=1": curves, "epsilon=2": curves})
    assert both.get_figwidth() == figure.get_figwidth()  # however many cases, it can be read at a column's width
    assert both.get_figheight() > figure.get_figheight()
