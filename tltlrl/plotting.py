"""Figures, from the CSV files alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import bootstrap

Array = NDArray[np.float64]

# Told apart in grey by lightness and dash, and by colour (Okabe and Ito's palette, safe for colour-blind readers).
STYLES: dict[str, dict[str, Any]] = {
    "tltl_episodic": {"color": "#000000", "linestyle": "-"},
    "discrete_episodic": {"color": "#D55E00", "linestyle": "--"},
    "continuous_episodic": {"color": "#0072B2", "linestyle": "-."},
    "discrete_step": {"color": "#E69F00", "linestyle": ":"},
    "continuous_step": {"color": "#56B4E9", "linestyle": (0, (5, 1, 1, 1, 1, 1))},
}
LABELS = {
    "tltl_episodic": "TLTL robustness, episode-based",
    "discrete_episodic": "discrete, episode-based",
    "continuous_episodic": "continuous, episode-based",
    "discrete_step": "discrete, step-based",
    "continuous_step": "continuous, step-based",
}
FONT: dict[Any, Any] = {"font.size": 9, "axes.titlesize": 9, "legend.fontsize": 8, "pdf.fonttype": 42}
RESAMPLES = 2000


def plot_learning_curves(curves: pd.DataFrame, path: Path, title: str) -> None:
    """Robustness against iterations, one line per case, as path.png and path.pdf.

    Args:
      curves: learning_curves.csv.
      path: without suffix.
      title: above the axes.
    """
    with mpl.rc_context(FONT):
        figure = Figure(figsize=(6.3, 4.2), layout="constrained")
        axes = figure.add_subplot()
        draw_learning_curves(axes, curves)
        axes.set_title(title)
        seeds, samples = curves["seed"].nunique(), curves["episodes"].min()
        figure.supxlabel(
            f"Mean of n = {seeds} seeds{_band_note(seeds)}; thin: each seed. {samples} sample trajectories per "
            "iteration.\nRobustness of the spec, of the sampled trajectories, whatever the case was trained on.",
            fontsize=7,
        )
        for suffix, metadata in ((".png", {"Software": None}), (".pdf", {"CreationDate": None})):
            figure.savefig(path.with_suffix(suffix), dpi=200, metadata=metadata)


def _band_note(seeds: int) -> str:
    return ", band: 95 % bootstrap interval of the mean" if seeds > 1 else ""


def draw_learning_curves(axes: mpl.axes.Axes, curves: pd.DataFrame) -> None:
    """Mean, band and every seed of each case's robustness_mean, on the given axes."""
    floor = float(curves["robustness_mean"].replace([np.inf, -np.inf], np.nan).min())
    for case, rows in curves.groupby("case", sort=False):
        style = STYLES.get(str(case), {})
        by_seed = rows.pivot(index="iteration", columns="seed", values="robustness_mean")
        values = by_seed.to_numpy().clip(min=floor)
        axes.plot(by_seed.index, values, linewidth=0.4, alpha=0.45, **style)
        if values.shape[1] > 1:
            low, high = bootstrap_band(values)
            axes.fill_between(by_seed.index, low, high, alpha=0.18, linewidth=0, color=style.get("color"))
        axes.plot(by_seed.index, values.mean(axis=1), linewidth=1.6, label=LABELS.get(str(case), str(case)), **style)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    axes.annotate(
        "satisfied above", (1.0, 0.0), xycoords=("axes fraction", "data"), xytext=(-3, 2), textcoords="offset points",
        ha="right", va="bottom", fontsize=7, color="0.3",
    )  # fmt: skip
    axes.set_xlabel("iteration")
    axes.set_ylabel("robustness (m)")
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)


def bootstrap_band(values: Array) -> tuple[Array, Array]:
    """95 % percentile bootstrap interval of the mean over the columns: (T, seeds) => two of shape (T,)."""
    interval = bootstrap(
        (values.T,), np.mean, axis=0, vectorized=True, n_resamples=RESAMPLES, method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return np.asarray(interval.low), np.asarray(interval.high)
