"""A picture of one recorded trajectory: its signals, and what a spec says of it over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.logic import Explanation, Spec
from tltlrl.logic.trace import columns

Array = NDArray[np.float64]


def draw(spec: Spec, signals: Mapping[str, Array], why: Explanation, path: str | Path) -> None:
    """Signals and sub-formulas over time, the deciding moment marked.

    Args:
      spec: that was evaluated.
      signals: of one trajectory, shapes (1, T) and (1, T, d).
      why: what decides its robustness.
      path: of the picture; its suffix says which kind.

    Raises:
      UserError: if it cannot be saved.
    """
    curves = {**spec.definitions_over_time(signals), "spec": spec.robustness_over_time(signals)}
    panels = len(signals) + 1
    figure = Figure(figsize=(8, 1.6 * len(signals) + 3.2), layout="constrained")
    axes = figure.subplots(panels, 1, sharex=True, squeeze=False, height_ratios=[1.0] * len(signals) + [2.0])[:, 0]
    styles = ["-", "--", "-.", ":"]
    greys = ["0.0", "0.35", "0.6"]
    for axis, (name, values) in zip(axes[:-1], signals.items(), strict=True):
        own = columns(name, spec.signals[name])
        for i, (label, curve) in enumerate(zip(own, values[0].reshape(len(values[0]), -1).T, strict=True)):
            axis.plot(curve, styles[i % 4], color=greys[i // 4 % 3], linewidth=1.2, label=_entry(label))
        axis.set_ylabel(name)
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    last = axes[-1]
    for i, (name, values) in enumerate(curves.items()):
        finite = np.where(np.isfinite(values[0]), values[0], np.nan)
        is_spec = name == "spec"
        last.plot(
            finite,
            "-" if is_spec else styles[(i + 1) % 4],
            color="tab:red" if is_spec else greys[i // 4 % 3],
            linewidth=2.2 if is_spec else 1.2,
            label=_entry(name),
        )
    last.axhline(0, color="0.7", linewidth=0.8, zorder=0)
    for axis in axes:
        axis.axvline(why.step, color="tab:red", linewidth=0.8, linestyle=(0, (1, 2)))
        axis.spines[["top", "right"]].set_visible(False)
    if why.predicate is not None:
        last.plot(why.step, why.value, "o", color="tab:red", markersize=7, markerfacecolor="white", zorder=5)
    last.set_title(f"decided {why.decided_by}", fontsize=9, loc="left")
    last.set_xlabel("step")
    last.set_ylabel("robustness from here on")
    last.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    axes[0].set_title(
        f"{spec.formula if len(spec.formula) < 70 else 'spec'}: {why.value:+.4g}", fontsize=10, loc="left"
    )
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise UserError(f"{path}: the picture cannot be saved: {error.strerror}; give another path") from None


def _entry(label: str) -> str:
    """A legend's entry: Matplotlib leaves out those that begin with _."""
    return f" {label}"
