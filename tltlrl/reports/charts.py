"""Line charts as SVG for a page, which shows the values under the pointer."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from tltlrl.reports.plotting import faintness

Array = NDArray[np.float64]

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 460, 260, 68, 12, 10, 40
MOST_POINTS, MOST_OF_THIN = 150, 75  # of a line: more than a page can show
DASHES = ("", "7 4", "9 3 2 3", "2 3", "9 3 2 3 2 3", "1 2")
COLOURS = 6  # of page.css


@dataclass(frozen=True)
class Line:
    """One line of a chart.

    Attributes:
      name: its name in the legend.
      y: values, (T,); the line has a gap where they are not finite.
      thin: thin lines beside it, (n, T), such as one per seed.
      band: low and high edge of its band, (T,) each.
    """

    name: str
    y: Array
    thin: Array = field(default_factory=lambda: np.empty((0, 0)))
    band: tuple[Array, Array] | None = None


def chart(identifier: str, x: Array, lines: Sequence[Line], limits: tuple[float, float], text: str, unit: str) -> str:
    """A chart with its legend and its values, as HTML.

    Args:
      identifier: unique on the page.
      x: iterations, (T,).
      lines: what is drawn; they differ in colour and in dash.
      limits: of the y axis.
      text: description for readers who cannot see the chart.
      unit: label of the y axis.
    """
    chosen, few = (
        np.unique(np.linspace(0, len(x) - 1, min(len(x), n)).astype(int)) for n in (MOST_POINTS, MOST_OF_THIN)
    )
    low, high = limits
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM

    def across(values: Array) -> Array:
        return LEFT + (right - LEFT) * (values - x[0]) / max(float(x[-1] - x[0]), 1.0)

    def down(values: Array) -> Array:
        return bottom - (bottom - TOP) * (values - low) / (high - low)

    parts = []
    for tick in MaxNLocator(5).tick_values(low, high):
        if low <= tick <= high:
            y = float(down(np.array(tick)))
            parts.append(f'<path class="grid" d="M{LEFT} {y:.1f}H{right}"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{tick:.4g}</text>')
    for tick in MaxNLocator(6, integer=True).tick_values(x[0], x[-1]):
        if x[0] <= tick <= x[-1]:
            at = float(across(np.array(tick)))
            parts.append(f'<text x="{at:.1f}" y="{bottom + 16}" text-anchor="middle">{tick:.0f}</text>')
    parts.append(f'<path class="axis" d="M{LEFT} {TOP}V{bottom}H{right}"/>')
    parts.append(f'<text x="{(LEFT + right) / 2}" y="{HEIGHT - 6}" text-anchor="middle">iteration</text>')
    parts.append(
        f'<text transform="translate(13 {(TOP + bottom) / 2}) rotate(-90)" text-anchor="middle">{escape(unit)}</text>'
    )
    inside = []
    for i, line in enumerate(lines):
        colour = f"var(--c{i % COLOURS})"
        if line.band is not None and np.isfinite(line.band[0]).any():
            edge = [_points(across(x), down(side), chosen)[0] for side in line.band]
            joined = " ".join([*edge[0].split(), *reversed(edge[1].split())])
            inside.append(f'<polygon class="band" points="{joined}" style="fill:{colour}"/>')
        faint = faintness(len(line.thin)) if len(line.thin) else 1.0
        for thin in line.thin if len(line.thin) > 1 else ():
            inside += [
                f'<polyline class="seed" points="{piece}" style="stroke:{colour};stroke-opacity:{faint:.2g}"/>'
                for piece in _points(across(x), down(thin), few)
            ]
        inside += [
            f'<polyline class="mean" points="{piece}" style="stroke:{colour};stroke-dasharray:{_dash(i)}"/>'
            for piece in _points(across(x), down(line.y), chosen)
        ]
    values = {
        "x": [int(value) for value in x[chosen]],
        "left": LEFT,
        "right": right,
        "lines": [[line.name, [_rounded(value) for value in line.y[chosen]]] for line in lines],
    }
    key = "".join(
        f'<span><svg viewBox="0 0 36 10" aria-hidden="true"><path class="mean" d="M0 5H36" '
        f'style="stroke:var(--c{i % COLOURS});stroke-dasharray:{_dash(i)}"/></svg> {escape(line.name)}</span>'
        for i, line in enumerate(lines)
    )
    return (
        f'<div class="key">{key}</div><svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" tabindex="0" '
        f'data-chart="{identifier}" aria-label="{escape(text)} Arrow keys read the values.">'
        f'<clipPath id="{identifier}-clip"><rect x="{LEFT}" y="{TOP}" width="{right - LEFT}" height="{bottom - TOP}"/>'
        f'</clipPath>{"".join(parts)}<g clip-path="url(#{identifier}-clip)">{"".join(inside)}</g>'
        f'<line class="cursor" y1="{TOP}" y2="{bottom}"/></svg>'
        f'<div class="told" id="{identifier}-told" aria-live="polite"></div>{data(identifier, values)}'
    )


def data(identifier: str, values: Any) -> str:
    """Values for the page's script, which can hold no tag that ends the script."""
    text = json.dumps(values, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="{identifier}">{text}</script>'


def _dash(i: int) -> str:
    return DASHES[i % len(DASHES)] or "none"


def _points(x: Array, y: Array, chosen: NDArray[np.intp]) -> list[str]:
    """The pieces of a line between its gaps."""
    known = chosen[np.isfinite(y[chosen])]
    gaps = np.flatnonzero(np.diff(np.searchsorted(chosen, known)) > 1) + 1
    pieces = (
        zip(x[piece].tolist(), np.clip(y[piece], -2e3, 2e3).tolist(), strict=True) for piece in np.split(known, gaps)
    )
    return [" ".join([f"{left:.1f},{below:.1f}" for left, below in piece]) for piece in pieces]


def _rounded(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None
