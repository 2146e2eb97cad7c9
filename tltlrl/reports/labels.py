"""Places labels in a picture: beside what they name, and on nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

Array = NDArray[np.float64]

DIRECTIONS = np.deg2rad(np.arange(0, 360, 15) - 90)  # below first
DISTANCES = (4.0, 12.0, 24.0, 40.0, 60.0, 84.0)  # points, from the edge of what is named
ON_LABEL, OUTSIDE, ON_REGION, ON_PATH = 1000.0, 1000.0, 30.0, 1.0  # costs; of the path for each of its points
FARTHER = 4.0  # for each distance


@dataclass(frozen=True)
class Label:
    """A text about a place.

    Attributes:
      text: one or a few lines; empty for a place that other labels must leave free.
      at: (x, y) of the place, in data coordinates.
      reach: radius of what it names, in data coordinates.
    """

    text: str
    at: tuple[float, float]
    reach: float = 0.0


def place(axes: Axes, labels: Sequence[Label], path: Array, size: float = 7.0) -> list[Bbox]:
    """Draws labels beside what they name, with a line to it if it is farther away.

    The figure must have been laid out (`figure.draw_without_rendering`), and its layout must not change later.

    Args:
      axes: where to draw.
      labels: the labels; earlier ones choose their place first.
      path: points that labels should leave free, (P, 2), in data coordinates.
      size: font size, points.

    Returns:
      The box of each label, in pixels.
    """
    point = axes.figure.dpi / 72
    to_pixels = axes.transData
    points = to_pixels.transform(path)
    centres = to_pixels.transform([label.at for label in labels])
    scale = float(np.linalg.norm(to_pixels.transform((1.0, 0.0)) - to_pixels.transform((0.0, 0.0))))
    reaches = np.array([label.reach * scale for label in labels])
    free = axes.get_window_extent()
    taken: list[Bbox] = []
    for i, label in enumerate(labels):
        if not label.text:
            continue
        text = axes.annotate(
            label.text, label.at, xytext=(0, 0), textcoords="offset points", ha="center", va="center", fontsize=size,
            zorder=7, linespacing=1.1,
            bbox={"boxstyle": "square,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
            arrowprops={"arrowstyle": "-", "color": "0.3", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
        extent = text.get_window_extent()
        others = np.linalg.norm(centres - centres[i], axis=1) >= reaches  # not those that hold what is named
        others[i] = False
        half = np.array([extent.width, extent.height]) / 2 + 1.5 * point
        best, cost, near = centres[i], np.inf, True
        for ring, distance in enumerate(DISTANCES):
            for angle in DIRECTIONS:
                direction = np.array([np.cos(angle), np.sin(angle)])
                # So far that the box, not its centre, keeps the distance.
                out = min(half / np.maximum(np.abs(direction), 1e-9)) + reaches[i] + distance * point
                centre = centres[i] + out * direction
                box = Bbox([centre - half, centre + half])
                own = FARTHER * ring
                own += ON_LABEL * sum(box.overlaps(other) for other in taken)
                own += OUTSIDE * (not (free.contains(box.x0, box.y0) and free.contains(box.x1, box.y1)))
                gaps = np.linalg.norm(np.maximum(np.abs(centres - centre) - half, 0.0), axis=1)
                own += ON_REGION * (others & (gaps < np.maximum(reaches, 4 * point))).sum()
                own += ON_PATH * np.all(np.abs(points - centre) < half, axis=1).sum()
                if own < cost:
                    best, cost, near = centre, own, ring == 0
        text.set_position(tuple((best - centres[i]) / point))
        if near and text.arrow_patch is not None:
            text.arrow_patch.set_visible(False)
        taken.append(Bbox([best - half, best + half]))
    return taken
