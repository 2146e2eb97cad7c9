"""Draws figures of learning curves, and saves figures with the same bytes every time."""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.reports.interval import FEWEST, LEVEL, mean_interval
from tltlrl.store.files import write_bytes

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
# The same for lines that are no cases.
GREY_STYLES: list[dict[str, Any]] = [
    {"color": "#000000", "linestyle": "-"},
    {"color": "#D55E00", "linestyle": "--"},
    {"color": "#56B4E9", "linestyle": "-"},
    {"color": "#0072B2", "linestyle": "-."},
    {"color": "#E69F00", "linestyle": ":"},
    {"color": "#009E73", "linestyle": (0, (5, 1, 1, 1, 1, 1))},
    {"color": "#CC79A7", "linestyle": "--"},
    {"color": "#777777", "linestyle": ":"},
]
LABELS = {
    "tltl_episodic": "TLTL robustness, episode-based",
    "discrete_episodic": "discrete, episode-based",
    "continuous_episodic": "continuous, episode-based",
    "discrete_step": "discrete, step-based",
    "continuous_step": "continuous, step-based",
    "tltl_step": "TLTL robustness, step-based",
}
PANELS = {  # what is drawn of learning_curves.csv
    "robustness_mean": "sampled trajectories",
    "robustness_policy": "mean policy, without noise",
}
STYLE: dict[Any, Any] = {
    "font.size": 9, "axes.titlesize": 9, "legend.fontsize": 8, "pdf.fonttype": 42, "svg.hashsalt": "tltlrl"
}  # fmt: skip
# Without what differs between two savings.
FORMATS: dict[str, dict[str, str | None]] = {".png": {"Software": None}, ".pdf": {"CreationDate": None}}
UNDATED = FORMATS | {".svg": {"Date": None}}
SOURCE = {".png": "Source", ".pdf": "Subject"}  # the words of the formats for where a picture is from
END = {".png": b"IEND\xaeB`\x82", ".pdf": b"%%EOF"}
DISTINCT = 14  # seeds whose thin lines can be told apart, and from their mean
DETAIL = 3.0  # a second row of panels reaches this many times as far below 0 as the best curve above,
NEEDED = 6.0  # where the worst curve goes this many times as far


def titled(folders: Sequence[Path], experiments: Sequence[pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Title => curves of each folder. A title is the task's name, with the experiment's name if it differs.

    If titles are equal, they are the whole paths.
    """
    names = [folder.resolve().name for folder in folders]
    tasks = [str(curves["task"].iloc[0]) for curves in experiments]
    titles = [task if name == task else f"{task}: {name}" for task, name in zip(tasks, names, strict=True)]
    if len(set(titles)) < len(titles):
        titles = [f"{task}: {folder}" for task, folder in zip(tasks, folders, strict=True)]
    return dict(zip(titles, experiments, strict=True))


@contextlib.contextmanager
def own_style() -> Iterator[None]:
    """Within this context figures do not depend on the user's matplotlibrc."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def plot_learning_curves(experiments: Mapping[str, pd.DataFrame], path: Path) -> None:
    """Draws the figure of the learning curves, as path.png and path.pdf.

    Args:
      experiments: title => learning_curves.csv.
      path: without suffix.
    """
    with own_style():
        save(curves_figure(experiments), path)


def curves_figure(experiments: Mapping[str, pd.DataFrame]) -> Figure:
    """The figure of robustness against iterations, with one line per case and one column per experiment.

    Rows: the sampled trajectories; the same near 0, if the worst curves leave too little room there; the mean policy,
    which trials and tables are about.

    Args:
      experiments: title => learning_curves.csv.
    """
    with own_style():
        near = {title: near_zero(curves, "robustness_mean") for title, curves in experiments.items()}
        rows, columns = 2 + any(near.values()), len(experiments)
        figure = Figure(
            figsize=(0.5 + (5.0 if columns == 1 else 3.3 * columns), 1.7 + 2.3 * rows), layout="constrained"
        )
        for column, (title, curves) in enumerate(experiments.items(), start=1):
            above = figure.add_subplot(rows, columns, column)
            draw_curves(above, curves, "robustness_mean")
            above.set_title(f"{title}\n{PANELS['robustness_mean']}")
            if limits := near[title]:
                axes = figure.add_subplot(rows, columns, columns + column)
                draw_curves(axes, curves, "robustness_mean")
                axes.set_ylim(limits)
                axes.set_title("the same, near 0")
            axes = figure.add_subplot(rows, columns, (rows - 1) * columns + column)
            draw_curves(axes, curves, "robustness_policy")
            axes.set_title(PANELS["robustness_policy"])
            if limits := near_zero(curves, "robustness_policy"):
                axes.set_ylim(limits)
                axes.set_title(f"{PANELS['robustness_policy']}, near 0")
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
        figure.supxlabel("\n".join(_caption(list(experiments.values()))), fontsize=7)
    return figure


def _caption(experiments: Sequence[pd.DataFrame]) -> list[str]:
    """The caption: what the figure shows, and over how many seeds."""
    counts = {int(curves.groupby("case")["seed"].nunique().max()) for curves in experiments}
    samples = dict.fromkeys(int(curves["episodes"].min()) for curves in experiments)
    seeds = " and ".join(f"{n} seed{'s' * (n > 1)}" for n in sorted(counts))
    lines = [f"{seeds}; {' and '.join(map(str, samples))} sample trajectories per iteration."]
    if max(counts) > 1:
        band = f"; band: {100 * LEVEL:.0f} % t interval of the mean" if max(counts) >= FEWEST else ""
        some = f" (of {FEWEST} seeds or more)" if band and min(counts) < FEWEST else ""
        lines.append(f"Thick: mean of the seeds; thin: each seed{band}{some}.")
    lines.append("Robustness of the spec, in the unit of its predicates, whatever the case was trained on.")
    return lines


def near_zero(curves: pd.DataFrame, measure: str) -> tuple[float, float] | None:
    """Limits of a panel near 0, if the curves need one."""
    best, worst = curves[measure].max(), curves[measure].min()
    return (-DETAIL * best, 1.15 * best) if 0 < NEEDED * best < -worst else None


def stem(path: Path) -> Path:
    """The path of a picture without the suffix of its kind: fig for fig.png, and figure_3.3 for figure_3.3.

    Raises:
      UserError: if the suffix stands for a format that is not written.
    """
    suffix = path.suffix.lower()
    if suffix in FORMATS:
        return path.with_suffix("")
    if suffix[1:] in Figure().canvas.get_supported_filetypes():
        raise UserError(f"{path}: pictures are written as {' and '.join(FORMATS)}; give the path without {path.suffix}")
    return path


def save(figure: Figure, path: Path, source: str = "") -> None:
    """Saves path.png and path.pdf, with the same bytes for the same figure.

    Args:
      figure: the figure.
      path: path without suffix.
      source: what it was drawn from, such as a digest; the files keep it for `shows`.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    for suffix in FORMATS:
        content = picture(figure, suffix, 200, {SOURCE[suffix]: source} if source else {})
        figure.set_layout_engine("none")  # laid out once: the same picture in every format
        write_bytes(path.with_name(path.name + suffix), content)


def picture(figure: Figure, suffix: str, dpi: int, told: Mapping[str, str] | None = None) -> bytes:
    """A figure as a file's content, without a date: the same bytes for the same figure, whatever the matplotlibrc says.

    Args:
      figure: drawn within `own_style`.
      suffix: of the kind of picture, one of `UNDATED`.
      dpi: pixels per inch.
      told: words about it that the file keeps, by the format's names.
    """
    buffer = io.BytesIO()
    with own_style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph")  # a name in letters that the font lacks is drawn as boxes
        figure.savefig(buffer, format=suffix[1:], dpi=dpi, metadata={**UNDATED[suffix], **(told or {})})
    return buffer.getvalue()


def shows(path: Path, source: str) -> bool:
    """Whether path.png and path.pdf are there, whole, and pictures of this source.

    Args:
      path: without suffix.
      source: as given to `save`.
    """
    try:
        contents = {suffix: path.with_name(path.name + suffix).read_bytes() for suffix in FORMATS}
    except OSError:
        return False
    return all(content.rstrip().endswith(END[suffix]) for suffix, content in contents.items()) and all(
        source.encode() in content for content in contents.values()
    )


def faintness(count: int) -> float:
    """How much fainter the thin lines of this many seeds are, so that together they do not cover the mean."""
    return min(1.0, DISTINCT / count)


def draw_curves(
    axes: mpl.axes.Axes, curves: pd.DataFrame, measure: str, styles: Mapping[str, Mapping[str, Any]] = STYLES
) -> None:
    """Draws mean, band and every seed of one measure for each case; with a gap where a value is infinite."""
    for case, rows in curves.groupby("case", sort=False):
        style = styles.get(str(case), {})
        by_seed = rows.pivot(index="iteration", columns="seed", values=measure)
        values = by_seed.where(np.isfinite(by_seed)).to_numpy()
        if values.shape[1] > 1:
            alpha = 0.55 * faintness(values.shape[1])
            axes.plot(by_seed.index, values, linewidth=0.6, alpha=alpha, color=style.get("color"))
        low, high = mean_interval(values)
        if np.isfinite(low).any():
            axes.fill_between(by_seed.index, low, high, alpha=0.18, linewidth=0, color=style.get("color"))
        axes.plot(by_seed.index, values.mean(axis=1), linewidth=1.6, label=LABELS.get(str(case), str(case)), **style)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=0)
    axes.set_xlabel("iteration")
    axes.locator_params("x", integer=True)
    axes.set_ylabel("robustness\n(above 0: satisfied)")  # said here, where it covers no curve
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)
