"""Draws one recorded trajectory: its signals, and the robustness of the spec's parts over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.logic import Explanation, Spec
from tltlrl.logic.trace import columns
from tltlrl.reports.plotting import own_style, picture
from tltlrl.store.files import write_bytes

Array = NDArray[np.float64]
STYLES = ["-", "--", "-.", ":"]
GREYS = ["0.0", "0.35", "0.6"]
MOST_CURVES = len(STYLES) * len(GREYS)


def draw(spec: Spec, signals: Mapping[str, Array], why: Explanation, path: str | Path) -> None:
    """Draws signals and sub-formulas over time, with the deciding moment marked.

    Args:
      spec: the spec that was evaluated.
      signals: signals of one trajectory, shapes (1, T) and (1, T, d).
      why: what decides its robustness.
      path: path of the picture; its suffix sets the format.

    Raises:
      UserError: if it cannot be saved.
    """
    with own_style():
        content = picture(_figure(spec, signals, why), Path(path).suffix.lower(), 150)
    try:
        write_bytes(Path(path), content)
    except OSError as error:
        raise UserError(f"{path}: the picture cannot be saved: {error.strerror}; give another path") from None


def _figure(spec: Spec, signals: Mapping[str, Array], why: Explanation) -> Figure:
    curves = {**spec.definitions_over_time(signals), "spec": spec.robustness_over_time(signals)}
    panels = len(signals) + 1
    figure = Figure(figsize=(8, 1.6 * len(signals) + 3.2), layout="constrained")
    axes = figure.subplots(panels, 1, sharex=True, squeeze=False, height_ratios=[1.0] * len(signals) + [2.0])[:, 0]
    for axis, (name, values) in zip(axes[:-1], signals.items(), strict=True):
        parts = dict(zip(columns(name, spec.signals[name]), values[0].reshape(len(values[0]), -1).T, strict=True))
        _draw_curves(axis, parts)
        axis.set_ylabel(name)
    last = axes[-1]
    finite = {name: np.where(np.isfinite(values[0]), values[0], np.nan) for name, values in curves.items()}
    own = finite.pop("spec")
    _draw_curves(last, finite, why.name)
    last.plot(own, color="tab:red", linewidth=2.2, label=_entry("spec"))
    last.axhline(0, color="0.7", linewidth=0.8, zorder=0)
    for axis in axes:
        axis.axvline(why.step, color="tab:red", linewidth=0.8, linestyle=(0, (1, 2)))
        axis.spines[["top", "right"]].set_visible(False)
    if why.predicate is not None:
        last.plot(why.step, why.value, "o", color="tab:red", markersize=7, markerfacecolor="white", zorder=5)
    last.set_title(f"decided {why.decided_by}", fontsize=9, loc="left")
    last.set_xlabel("step")
    last.set_ylabel("robustness from here on")
    for axis in axes:
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    axes[0].set_title(
        f"{spec.formula if len(spec.formula) < 70 else 'spec'}: {why.value:+.4g}", fontsize=10, loc="left"
    )
    return figure


def _draw_curves(axis: Axes, curves: Mapping[str, Array], chosen: str | None = None) -> None:
    """Draws curves that a reader can tell apart; if there are too many, their band and the chosen one."""
    if len(curves) > MOST_CURVES:
        together = np.array(list(curves.values()))
        known = ~np.isnan(together).all(axis=0)
        steps = np.flatnonzero(known)
        names = list(curves)
        low, high = np.nanmin(together[:, known], axis=0), np.nanmax(together[:, known], axis=0)
        axis.fill_between(steps, low, high, color="0.85", label=_entry(f"{names[0]} to {names[-1]}"))
        axis.plot(steps, np.nanmedian(together[:, known], axis=0), "--", color="0.35", linewidth=1.2, label=" median")
        curves = {name: curve for name, curve in curves.items() if name == chosen}
    for i, (name, values) in enumerate(curves.items()):
        style, grey = STYLES[i % len(STYLES)], GREYS[i // len(STYLES)]
        axis.plot(values, style, color=grey, linewidth=1.2, label=_entry(name))


def _entry(label: str) -> str:
    """A legend's entry: Matplotlib leaves out those that begin with _."""
    return f" {label}"
