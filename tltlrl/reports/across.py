"""Compares several experiments: the same case in each, paired over seeds, and each case over all tasks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import bootstrap, trim_mean

from tltlrl.reports.comparison import holm, paired_p
from tltlrl.reports.interval import FEWEST, LEVEL, mean_interval
from tltlrl.reports.plotting import GREY_STYLES, LABELS, PANELS, draw_curves, own_style, save

Array = NDArray[np.float64]

MEASURES = {
    "robustness_policy": "robustness of the mean policy at the end",
    "robustness_mean_over_run": "robustness of the samples, mean over the run",
}
SCORES = {  # of equal size in every task, so that no task outweighs another
    "success_rate": "the share of successful trials",
    "robustness_share": "the robustness as a share of the best run's of its task",
}
RESAMPLES = 9999


@dataclass(frozen=True)
class Difference:
    """One case in two experiments of one task.

    Attributes:
      case, measure: the case, and the column of summary.csv.
      first, other: the experiments.
      seeds: the common seeds.
      mean: mean of first - other, in the measure's unit.
      low, high: its 95 % t interval over the seeds; NaN with fewer than `FEWEST`.
      p: p of a paired permutation test, Holm-corrected over all rows of the measure.
    """

    case: str
    measure: str
    first: str
    other: str
    seeds: int
    mean: float
    low: float
    high: float
    p: float

    def __str__(self) -> str:
        interval = f" ({self.low:+.3f} to {self.high:+.3f})" if np.isfinite(self.low) else ""
        better = "not told apart"
        if self.p < 1 - LEVEL:
            better = f"{self.first if self.mean > 0 else self.other} is better"
        return (
            f"{self.case}, {MEASURES[self.measure]}: {self.first} - {self.other} {self.mean:+.3f}{interval}, "
            f"p {self.p:.3g}, {self.seeds} seeds: {better}"
        )


def differences(summaries: Mapping[str, pd.DataFrame]) -> list[Difference]:
    """Compares the first experiment with each other one of the same task, in each case that both have.

    Args:
      summaries: name of the experiment => summary.csv.
    """
    (first, own), *others = summaries.items()
    found = []
    for measure in MEASURES:
        rows = []
        for other, table in others:
            if table["task"].iloc[0] != own["task"].iloc[0]:
                continue
            for case in [case for case in own["case"].unique() if case in set(table["case"])]:
                a, b = (rows_of[rows_of["case"] == case].set_index("seed")[measure] for rows_of in (own, table))
                seeds = a.index.intersection(b.index)
                if len(seeds):
                    x, y = a.loc[seeds].to_numpy(dtype=float), b.loc[seeds].to_numpy(dtype=float)
                    low, high = mean_interval(x - y)
                    mean, p = float(np.mean(x - y)), paired_p(x, y)
                    rows.append(Difference(case, measure, first, other, len(seeds), mean, float(low), float(high), p))
        corrected = holm([row.p for row in rows])
        found += [Difference(**{**vars(row), "p": p}) for row, p in zip(rows, corrected, strict=True)]
    return found


@dataclass(frozen=True)
class Aggregate:
    """A score of a case over several tasks: the interquartile mean over runs.

    Attributes:
      case: name of the case.
      score: one of `SCORES`.
      tasks, runs: how many there are.
      mean: mean of the middle half of the runs.
      low, high: its 95 % percentile bootstrap interval, with runs drawn within each task.
    """

    case: str
    score: str
    tasks: int
    runs: int
    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        return (
            f"{self.case}, {self.tasks} tasks, {self.runs} runs: interquartile mean of {SCORES[self.score]} "
            f"{self.mean:.3f} ({self.low:.3f} to {self.high:.3f})"
        )


def over_tasks(summaries: Sequence[pd.DataFrame]) -> list[Aggregate]:
    """Aggregates every case that all tasks have; nothing for a single task.

    Robustness has the unit of its spec, and so is divided by that of the task's best run, of any case: 1 is as good as
    the best, 0 or less violates the spec. It is left out if `never_satisfied` has a task. Measure and interval
    follow Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice (2021).
    """
    together = pd.concat(summaries, ignore_index=True)
    best = _best(summaries)
    if len(best) < 2:
        return []
    together["robustness_share"] = together["robustness_policy"] / together["task"].map(best)
    scores = [score for score in SCORES if score != "robustness_share" or not never_satisfied(summaries)]
    found = []
    for score in scores:
        for case in together["case"].unique():
            own = together[together["case"] == case]
            runs = [own.loc[own["task"] == task, score].to_numpy(dtype=float) for task in best.index]
            if min(map(len, runs)) < 2:
                continue
            mean = float(trim_mean(np.concatenate(runs), 0.25))
            found.append(Aggregate(case, score, len(best), sum(map(len, runs)), mean, *_bootstrapped(runs)))
    return found


def never_satisfied(summaries: Sequence[pd.DataFrame]) -> list[str]:
    """The tasks of which no run satisfies its spec; they give robustness nothing to be divided by."""
    best = _best(summaries)
    return [str(task) for task in best.index[~(best > 0)]]


def _best(summaries: Sequence[pd.DataFrame]) -> pd.Series[float]:
    """Task => the robustness of its best run."""
    return pd.concat(summaries).groupby("task", sort=False)["robustness_policy"].max()


def _bootstrapped(runs: Sequence[Array]) -> tuple[float, float]:
    """The interval of the interquartile mean over all runs; `runs` has the scores of each task."""
    interval = bootstrap(
        runs,
        lambda *samples, axis: trim_mean(np.concatenate(samples, axis=axis), 0.25, axis=axis),
        n_resamples=RESAMPLES,
        confidence_level=LEVEL,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(interval.low), float(interval.high)


def plot_cases(experiments: Mapping[str, pd.DataFrame], path: Path) -> None:
    """Draws the curves by case, as path.png and path.pdf: a row per shared case, a line per experiment.

    Args:
      experiments: name => learning_curves.csv, of one task.
      path: without suffix.
    """
    with own_style():
        save(cases_figure(experiments), path)


def cases_figure(experiments: Mapping[str, pd.DataFrame]) -> Figure:
    """The figure of `plot_cases`."""
    counted = Counter(case for curves in experiments.values() for case in curves["case"].unique())
    cases = [case for case, count in counted.items() if count > 1]
    styles = {name: GREY_STYLES[i % len(GREY_STYLES)] for i, name in enumerate(experiments)}
    with own_style():
        size = 3.4 * len(PANELS), 0.6 + 2.2 * len(cases) + 0.2 * len(experiments)
        figure = Figure(figsize=size, layout="constrained")  # narrow, to be read at the width of a column
        grid = figure.subplots(len(cases), len(PANELS), squeeze=False)
        for row, case in zip(grid, cases, strict=True):
            own = {name: curves[curves["case"] == case] for name, curves in experiments.items()}
            together = pd.concat([rows.assign(case=name) for name, rows in own.items() if len(rows)])
            for axes, (measure, of) in zip(row, PANELS.items(), strict=True):
                draw_curves(axes, together, measure, styles)
                axes.set_title(f"{LABELS.get(case, case)}\n{of}")
                axes.set_ylim(_limits(together, measure))
        lines = {
            label: line for axes in figure.axes for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(lines.values(), lines.keys(), loc="outside upper left", frameon=False)
        counts = sorted({int(curves.groupby("case")["seed"].nunique().max()) for curves in experiments.values()})
        band = f"; band: {100 * LEVEL:.0f} % t interval of the mean, of {FEWEST} seeds or more" * (counts[-1] >= FEWEST)
        seeds = " and ".join(f"{n} seed{'s' * (n > 1)}" for n in counts)
        figure.supxlabel(
            f"{seeds}. Thick: mean of the seeds; thin: each seed{band}. Lower values are cut off.",
            fontsize=7.5,
        )
    return figure


def _limits(curves: pd.DataFrame, measure: str) -> tuple[float, float]:
    """Limits that hold every mean after the first quarter of the iterations; the start would set the scale."""
    finite = curves[np.isfinite(curves[measure])]
    means = finite.groupby(["case", "iteration"])[measure].mean().reset_index()
    later = means.loc[means["iteration"] >= curves["iteration"].max() / 4, measure]
    low, high = min(float(later.min()), 0.0), max(float(finite[measure].max()), 0.0)
    margin = 0.06 * ((high - low) or 1.0)
    return low - margin, high + margin
