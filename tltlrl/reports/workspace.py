"""A picture of a learned motion: regions of the spec, sampled paths, and the mean path coloured by time."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from copy import copy
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Rectangle
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.logic import Region
from tltlrl.reports.labels import Label, place
from tltlrl.reports.motion import Motion, entries, has_path, path_of, watch
from tltlrl.reports.plotting import LABELS, own_style, save
from tltlrl.simulation.simulator import simulator_of
from tltlrl.tasks.task import Task
from tltlrl.training.build import make_task
from tltlrl.training.study import Run

Array = NDArray[np.float64]

POSES = 6  # of the arm, evenly spread over the motion
TOLD = 3  # entries of one region that are named
WIDTH, HEIGHT = 6.4, 5.3  # inches
# Later is darker, in grey, too; the palest colours of the map would be lost on white.
TIME = LinearSegmentedColormap.from_list("time", mpl.colormaps["viridis_r"](np.linspace(0.22, 1.0, 256)))


def can_draw(run: Run) -> bool:
    """Whether there is a path that can be drawn."""
    return has_path(make_task(run.task), run.spec)


def draw_workspace(run: Run, policy: Policy, path: Path, count: int = 20, source: str = "") -> None:
    """The learned motion, as path.png and path.pdf; `path` is without suffix. See `workspace_figure` and `save`."""
    with own_style():
        save(workspace_figure(run, policy, count), path, source)


def workspace_figure(run: Run, policy: Policy, count: int = 20) -> Figure:
    """The learned motion in the plane; in space, seen from above and from the side.

    Args:
      run: for which `can_draw` holds.
      policy: learned by the run.
      count: sampled paths, with the policy's remaining exploration and the actuators' noise.
    """
    task = make_task(run.task)
    simulator = simulator_of(task)
    rng = np.random.default_rng([run.seed, run.algorithm.iterations])
    sampled = simulator.rollout(policy.gain, policy.sample(count, rng), simulator.draw_command_noise(count, rng))
    sampled_paths = path_of(task, run.spec, sampled.features, task.signals(sampled.features, sampled.commands))
    motion = watch(task, run.spec, policy, simulator)
    assert motion.path is not None
    views = views_of(motion.path)

    with own_style():
        figure = Figure(figsize=(WIDTH, HEIGHT))
        caption = _caption(task, motion, run, count)
        low = (0.62 + 0.13 * (1 + caption.count("\n"))) / HEIGHT
        top = 0.93 if len(views) == 1 else 0.89
        left, between = (0.1, 0.0) if len(views) == 1 else (0.125, 0.42)  # of two views, numbers may be longer
        grid = figure.add_gridspec(1, len(views), left=left, right=0.87, top=top, bottom=low, wspace=between)
        all_axes = [figure.add_subplot(grid[i]) for i in range(len(views))]
        for axes, view in zip(all_axes, views, strict=True):
            _draw_view(axes, task, motion, view, sampled_paths)
            axes.apply_aspect()  # labels are placed in what is there now
            place(axes, _labels(motion, view), motion.path[:, view])
        time = ScalarMappable(Normalize(0.0, max(float(motion.times[-1]), task.control_timestep)), TIME)
        figure.colorbar(time, cax=figure.add_axes((0.89, low, 0.02, top - low)), label="time (s)")
        figure.text(0.485, 0.945, title_of(task, run), ha="center", va="bottom", fontsize=10)
        figure.text(0.5, 0.012, caption, ha="center", va="bottom", fontsize=7.5)
    return figure


def title_of(task: Task, run: Run) -> str:
    """Task, case and seed."""
    return f"{task.name}: {LABELS.get(run.case.name, run.case.name)}, seed {run.seed}"


def views_of(path: Array) -> list[tuple[int, int]]:
    """The projections in which a path, (T, 2 or 3), is drawn, as its two components: from above, and from the side."""
    return [(0, 1)] if path.shape[1] == 2 else [(0, 1), (0, 2)]


def _caption(task: Task, motion: Motion, run: Run, count: int) -> str:
    poses = f" Thin lines with dots: {POSES} poses of the robot." if task.skeleton is not None else ""
    text = (
        f"Robustness of the mean motion {motion.why.value:+.3f}, decided {motion.why.decided_by} (ring). "
        f"Coloured: its path by time, later darker (dot: start, square: end, triangle: a region is entered); grey: "
        f"{count} paths sampled from the learned policy (seed [{run.seed}, {run.algorithm.iterations}]).{poses} "
        "Plain regions: to be in; hatched: to be kept out of."
    )
    return "\n".join(textwrap.wrap(text, 108))


def _draw_view(axes: Axes, task: Task, motion: Motion, view: tuple[int, int], sampled: Array) -> None:
    """Everything in one projection."""
    assert motion.path is not None
    path = motion.path[:, view]
    draw_regions(axes, motion.regions, view)
    axes.add_collection(LineCollection(list(sampled[..., view]), colors="0.78", linewidths=0.3, zorder=2))
    if task.skeleton is not None:
        for i in np.linspace(0, len(path) - 1, POSES).astype(int):
            colour = TIME(i / max(len(path) - 1, 1))
            axes.plot(*task.skeleton(motion.features[i]).T, "-o", color=colour, linewidth=0.7, markersize=2, zorder=3)
    draw_path(axes, path, 0, len(path), 1.4)
    axes.plot(*path[0], "o", color=TIME(0.0), markeredgecolor="black", markersize=6, zorder=6)
    axes.plot(*path[-1], "s", color="black", markeredgecolor="white", markersize=6, zorder=6)
    for region in motion.regions:
        for step in entries(region, motion.path)[:TOLD]:
            axes.plot(*path[step], "^", color="white", markeredgecolor="black", markersize=5, zorder=6.2)
    at = path[motion.why.step]
    axes.plot(*at, "o", color="none", markeredgecolor="#D55E00", markeredgewidth=1.6, markersize=11, zorder=6.4)
    axes.margins(0.06)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    names = "xyz"
    axes.set_xlabel(f"{names[view[0]]} (m)")
    axes.set_ylabel(f"{names[view[1]]} (m)")
    if motion.path.shape[1] == 3:
        axes.set_title("from above" if view == (0, 1) else "from the side", fontsize=8)


def draw_path(axes: Axes, path: Array, start: int, stop: int, width: float) -> None:
    """A stretch coloured by the time of the whole path; each piece with a white edge, so that later ones pass over."""
    last = max(len(path) - 1, 1)
    pieces, colours, widths = [], [], []
    for i in range(start, min(stop, last), 3):
        piece = path[i : min(i + 4, stop + 1)]
        pieces += [piece, piece]
        colours += [(1.0, 1.0, 1.0, 1.0), TIME(i / last)]
        widths += [2.2 * width, width]
    axes.add_collection(LineCollection(pieces, colors=colours, linewidths=widths, zorder=4, capstyle="butt"))


def _labels(motion: Motion, view: tuple[int, int]) -> list[Label]:
    """What stands beside the regions and the mark of what decides, and the marks, which it must leave free."""
    assert motion.path is not None
    labels = []
    marks = [0, len(motion.path) - 1]
    for region in motion.regions:
        x, y, reach = _extent(region, view)
        steps = entries(region, motion.path)
        marks += steps[:TOLD]
        when = ", ".join(f"{motion.times[step]:.4g} s" for step in steps[:TOLD]) + (", …" if len(steps) > TOLD else "")
        if region.inside:
            text = f"{region.name or 'region'}\n{when or 'never entered'}"
        elif steps:
            text = f"entered\n{when}"
        else:
            text = ""
        labels.append(Label(text, (x, y), reach))
    at = motion.path[motion.why.step][list(view)]
    labels.append(Label(f"decides, {motion.times[motion.why.step]:.4g} s", (float(at[0]), float(at[1])), 0.0))
    points = motion.path[marks][:, list(view)].tolist()
    return [*labels, *(Label("", (x, y)) for x, y in points)]


def _extent(region: Region, view: tuple[int, int]) -> tuple[float, float, float]:
    """Centre and reach of a region in a projection."""
    if region.centre is not None:
        return region.centre[view[0]], region.centre[view[1]], region.radius or 0.0
    assert region.lower is not None
    assert region.upper is not None
    lower, upper = np.array(region.lower)[list(view)], np.array(region.upper)[list(view)]
    (x, y), half = (lower + upper) / 2, (upper - lower) / 2
    return float(x), float(y), float(half.max())


def draw_regions(axes: Axes, regions: Sequence[Region], view: tuple[int, int]) -> None:
    """Every ball and box in a projection."""
    for region in regions:
        if region.centre is not None:
            shape: Patch = Circle((region.centre[view[0]], region.centre[view[1]]), region.radius or 0.0)
        else:
            assert region.lower is not None
            assert region.upper is not None
            (left, bottom), (right, top) = (
                (corner[view[0]], corner[view[1]]) for corner in (region.lower, region.upper)
            )
            shape = Rectangle((left, bottom), right - left, top - bottom)
        shape.set(facecolor="0.92", edgecolor="0.3", linewidth=0.8, hatch=None if region.inside else "////", zorder=1)
        axes.add_patch(shape)
        outline = copy(shape)  # above the paths, which may cover all of a small region
        outline.set(fill=False, hatch=None, zorder=5)
        axes.add_patch(outline)
