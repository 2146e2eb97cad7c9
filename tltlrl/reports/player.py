"""A motion that a page plays: the path, the robot where the task knows it as a polyline, and each clause so far."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from tltlrl.logic import Region
from tltlrl.reports.charts import data
from tltlrl.reports.motion import Motion, entries
from tltlrl.reports.workspace import views_of
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]

SIZE, EDGE = 320.0, 16.0  # of a view


def player(identifier: str, task: Task, motion: Motion, name: str) -> str:
    """The HTML that plays the motion of a policy; without a path, only its clauses.

    Args:
      identifier: unique on the page.
      task: what was simulated.
      motion: of the policy.
      name: of the policy, for readers.
    """
    views = [] if motion.path is None else views_of(motion.path)
    robot = np.empty((0, 0, 2))
    if task.skeleton is not None and len(views) == 1:
        robot = task.skeleton(motion.features)
    drawn, paths, shown = [], [], robot
    for i, view in enumerate(views):
        assert motion.path is not None
        path = motion.path[:, view]
        to_view = _Scale(np.concatenate([path, robot.reshape(-1, 2), *_corners(motion.regions, view)]))
        paths.append(to_view(path))
        if i == 0 and len(robot):
            shown = to_view(robot)
        drawn.append(_view(motion, view, path, to_view, bool(len(robot)), name))
    values = {
        "period": task.control_timestep,
        "times": [round(float(t), 4) for t in motion.times],
        "decides": motion.why.step,
        "paths": [np.round(path, 1).tolist() for path in paths],
        "robot": np.round(shown, 1).tolist(),
        "clauses": [
            [float(f"{value:.3g}") if np.isfinite(value) else None for value in watched.now]
            for watched in motion.clauses.values()
        ],
    }
    rows = "".join(
        f'<tr><td><code>{escape(text)}</code></td><td class="number" data-clause>{watched.now[-1]:.3g}</td>'
        f'<td class="number">{watched.now[-1]:.3g}</td></tr>'
        for text, watched in motion.clauses.items()
    )
    clauses = (
        f'<div class="wide"><table aria-label="clauses of {escape(name)}"><thead><tr><th scope="col">clause</th>'
        '<th scope="col">if the motion ended now</th><th scope="col">at its end</th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
        if rows
        else ""
    )
    return (
        f'<div class="player" data-motion="{identifier}"><div class="views">{"".join(drawn)}</div>'
        f'<div class="controls"><button type="button" aria-label="Play or pause {escape(name)}">Play</button>'
        f'<input type="range" min="0" max="{len(motion.times) - 1}" value="{len(motion.times) - 1}" '
        f'aria-label="time of {escape(name)}"><span class="told">{motion.times[-1]:.4g} s</span></div>{clauses}</div>'
        f"{data(identifier, values)}"
    )


class _Scale:
    """Metres to the units of a view, y upwards, the same for both axes."""

    def __init__(self, points: Array) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        self._unit = (SIZE - 2 * EDGE) / max(float((high - low).max()), 1e-9)
        self.size = (high - low) * self._unit + 2 * EDGE
        self._low = low

    def __call__(self, points: Array) -> Array:
        scaled = (points - self._low) * self._unit + EDGE
        return np.stack([scaled[..., 0], self.size[1] - scaled[..., 1]], axis=-1)

    def length(self, metres: float) -> float:
        return metres * self._unit


def _corners(regions: Sequence[Region], view: tuple[int, int]) -> list[Array]:
    corners = []
    for region in regions:
        if region.centre is not None:
            centre, reach = np.array(region.centre)[list(view)], region.radius or 0.0
            corners.append(np.stack([centre - reach, centre + reach]))
        else:
            corners.append(np.array([region.lower, region.upper])[:, list(view)])
    return corners


def _view(motion: Motion, view: tuple[int, int], path: Array, scale: _Scale, robot: bool, name: str) -> str:
    parts, names, said = [], [], []
    assert motion.path is not None
    for region in motion.regions:
        style = "place" if region.inside else "place avoid"
        low, high = scale(_corners([region], view)[0])
        x, y, width, height = low[0], high[1], high[0] - low[0], low[1] - high[1]
        bend = width / 2 if region.centre is not None else 0.0
        parts.append(
            f'<rect class="{style}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="{bend:.1f}"/>'
        )
        steps = entries(region, motion.path)
        when = ", ".join(f"{motion.times[step]:.4g} s" for step in steps[:3]) or "never"
        if region.inside:
            names.append(
                f'<text class="name" x="{x + width / 2:.1f}" y="{y + height + 12:.1f}" text-anchor="middle">'
                f"{escape(region.name or '')}</text>"
            )
        if region.inside or steps:
            said.append(f"{region.name or 'a region'} {'' if region.inside else '(to be kept out of) '}entered {when}")
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in scale(path))
    parts.append(f'<polyline class="path" points="{points}"/><polyline class="done" points="{points}"/>')
    if robot:
        parts.append('<polyline class="robot" points=""/>')
    end = scale(path)[-1]
    parts.append(f'<circle class="point" cx="{end[0]:.1f}" cy="{end[1]:.1f}" r="4"/>')
    side = "" if motion.path.shape[1] == 2 else f", from {'above' if view == (0, 1) else 'the side'}"
    label = escape(f"Path of {name}{side}: {'; '.join(said) or 'no region is entered'}.")
    return (
        f'<figure><svg viewBox="0 0 {scale.size[0]:.0f} {scale.size[1]:.0f}" role="img" aria-label="{label}">'
        f"{''.join(parts + names)}</svg><figcaption>{label}</figcaption></figure>"
    )
