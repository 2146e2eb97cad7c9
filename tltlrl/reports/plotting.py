"""Figures, from the CSV files alone."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import bootstrap

from tltlrl.errors import UserError
from tltlrl.store.files import write_bytes
from tltlrl.store.layout import CURVES

Array = NDArray[np.float64]

# Told apart in grey by lightness and dash, and by colour (Okabe and Ito's palette, safe for colour-blind readers).
STYLES: dict[str, dict[str, Any]] = {
    "tltl_episodic": {"color": "#000000", "linestyle": "-"},
    "discrete_episodic": {"color": "#D55E00", "linestyle": "--"},
    "continuous_episodic": {"color": "#0072B2", "linestyle": "-."},
    "discrete_step": {"color": "#E69F00", "linestyle": ":"},
    "continuous_step": {"color": "#3E9ED6", "linestyle": (0, (5, 1, 1, 1, 1, 1))},
    "tltl_step": {"color": "#009E73", "linestyle": (0, (1, 1))},
}
LABELS = {
    "tltl_episodic": "TLTL robustness, episode-based",
    "discrete_episodic": "discrete, episode-based",
    "continuous_episodic": "continuous, episode-based",
    "discrete_step": "discrete, step-based",
    "continuous_step": "continuous, step-based",
    "tltl_step": "TLTL robustness, step-based",
}
FONT: dict[Any, Any] = {"font.size": 9, "axes.titlesize": 9, "legend.fontsize": 8, "pdf.fonttype": 42}
FORMATS = {".png": {"Software": None}, ".pdf": {"CreationDate": None}}  # without what differs between two savings
RESAMPLES = 2000
BATCH = 4_000_000  # numbers at a time; the band is the same for any
DETAIL = 3.0  # a second row of panels reaches this many times as far below 0 as the best curve above,
NEEDED = 6.0  # where the worst curve goes this many times as far


def read_curves(folder: Path) -> pd.DataFrame:
    """learning_curves.csv of an experiment's folder.

    Raises:
      UserError: if there is none, or it lacks a column or a row, or holds something that is not a number.
    """
    path = folder / CURVES
    try:
        text = path.read_text(encoding="utf-8")
        curves = pd.read_csv(io.StringIO(text))
    except (OSError, ValueError) as error:
        raise UserError(f"{path} cannot be read ({error}); give the folder of an experiment, as runs/NAME") from error
    if mistake := _mistake(curves, text):
        raise UserError(f"{path}: {mistake}; run the experiment again to write it anew")
    return curves


def _mistake(curves: pd.DataFrame, text: str) -> str | None:
    """What is wrong with the learning curves of this text, if anything."""
    needed = {"task", "case", "seed", "iteration", "episodes", "robustness_mean"}
    if missing := needed - set(curves.columns):
        return f"no column {', '.join(sorted(missing))}"
    if not text.endswith("\n"):
        return "its last line is cut off"
    if curves.empty or curves.duplicated(["case", "seed", "iteration"]).any():
        return "empty, or with an iteration twice"
    for name in ("seed", "iteration", "episodes", "robustness_mean"):
        if curves[name].isna().any() or not pd.api.types.is_numeric_dtype(curves[name]):
            return f"{name} has a value that is not a number"
    counts = curves.groupby(["case", "seed"], sort=False)["iteration"].agg(["size", "max"])
    (wrong,) = np.nonzero((counts["size"] != counts["size"].max()) | (counts["max"] + 1 != counts["size"]))
    if len(wrong):
        case, seed = counts.index[wrong[0]]
        return f"{case} seed {seed} has not the iterations of the others"
    return None


def plot_learning_curves(experiments: list[pd.DataFrame], path: Path) -> None:
    """Robustness against iterations, one line per case and one panel per experiment, as path.png and path.pdf.

    Where the worst curves leave the satisfied ones no room, a second row of panels shows these again.

    Args:
      experiments: their learning_curves.csv.
      path: without suffix.
    """
    with mpl.rc_context(FONT):
        details = [_detail(curves) for curves in experiments]
        rows, columns = 1 + any(details), len(experiments)
        figure = Figure(figsize=(0.5 + 5.0 * columns, 1.4 + 2.7 * rows), layout="constrained")
        notes = []
        for column, (curves, detail) in enumerate(zip(experiments, details, strict=True), start=1):
            axes = figure.add_subplot(rows, columns, column)
            draw_learning_curves(axes, curves)
            seeds, samples = curves["seed"].nunique(), curves["episodes"].min()
            axes.set_title(str(curves["task"].iloc[0]))
            notes.append(f"n = {seeds} seeds, {samples} sample trajectories per iteration")
            if detail:
                axes = figure.add_subplot(rows, columns, columns + column)
                draw_learning_curves(axes, curves)
                axes.set_ylim(detail)
                axes.set_title("the same, near 0")
        lines = {
            label: line for axes in figure.axes for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(
            lines.values(),
            lines.keys(),
            loc="outside upper center",
            ncols=2 if len(experiments) == 1 else 3,
            frameon=False,
        )
        figure.supxlabel(
            "\n".join(
                [
                    "; ".join(dict.fromkeys(notes)) + ".",
                    "Thick: mean of the seeds; band: 95 % percentile bootstrap interval of the mean; thin: each seed.",
                    "Robustness of the spec, of the sampled trajectories, whatever the case was trained on.",
                ]
            ),
            fontsize=7,
        )
        save(figure, path)


def _detail(curves: pd.DataFrame) -> tuple[float, float] | None:
    """Limits of the panel near 0, if the curves need one."""
    best, worst = curves["robustness_mean"].max(), curves["robustness_mean"].min()
    return (-DETAIL * best, 1.15 * best) if 0 < NEEDED * best < -worst else None


def save(figure: Figure, path: Path) -> None:
    """path.png and path.pdf, the same bytes for the same figure; a suffix of these that `path` has is not doubled."""
    stem = path.with_suffix("") if path.suffix in FORMATS else path
    stem.parent.mkdir(parents=True, exist_ok=True)
    for suffix, metadata in FORMATS.items():
        buffer = io.BytesIO()
        figure.savefig(buffer, format=suffix[1:], dpi=200, metadata=metadata)
        write_bytes(stem.with_name(stem.name + suffix), buffer.getvalue())


def draw_learning_curves(axes: mpl.axes.Axes, curves: pd.DataFrame) -> None:
    """Mean, band and every seed of each case's robustness_mean, on the given axes."""
    for case, rows in curves.groupby("case", sort=False):
        style = STYLES.get(str(case), {})
        by_seed = rows.pivot(index="iteration", columns="seed", values="robustness_mean")
        values = by_seed.where(np.isfinite(by_seed)).to_numpy()  # a gap where a mean is infinite
        axes.plot(by_seed.index, values, linewidth=0.4, alpha=0.5, color=style.get("color"))
        if values.shape[1] > 1:
            low, high = bootstrap_band(values)
            axes.fill_between(by_seed.index, low, high, alpha=0.18, linewidth=0, color=style.get("color"))
        axes.plot(by_seed.index, values.mean(axis=1), linewidth=1.6, label=LABELS.get(str(case), str(case)), **style)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    axes.annotate(
        "above 0: satisfied", (0.0, 0.0), xycoords=("axes fraction", "data"), xytext=(4, 2),
        textcoords="offset points", ha="left", va="bottom", fontsize=7, color="0.3",
    )  # fmt: skip
    axes.set_xlabel("iteration")
    axes.set_ylabel("robustness (m)")
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)


def bootstrap_band(values: Array) -> tuple[Array, Array]:
    """95 % percentile bootstrap interval of the mean over the columns: (T, seeds) => two of shape (T,).

    NaN where a value is.
    """
    band = np.full((2, len(values)), np.nan)
    known = np.isfinite(values).all(axis=1)
    if known.any():
        interval = bootstrap(
            (values[known].T,), np.mean, axis=0, vectorized=True, n_resamples=RESAMPLES, method="percentile",
            batch=max(1, BATCH // values.size), rng=np.random.default_rng(0),
        ).confidence_interval  # fmt: skip
        band[:, known] = interval.low, interval.high
    return band[0], band[1]
