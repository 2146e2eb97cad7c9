"""Draws a learned motion over time: its stretches one by one, its commands, and each clause so far."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tltlrl.learning.policy import Policy
from tltlrl.reports.motion import Motion, Watched, watch
from tltlrl.reports.plotting import own_style, save
from tltlrl.reports.workspace import TIME, WIDTH, draw_path, draw_regions, title_of, views_of
from tltlrl.simulation.simulator import simulator_of
from tltlrl.tasks.task import Task
from tltlrl.training.build import make_task
from tltlrl.training.study import Run

STRETCHES = 4  # of the motion, each with a picture of its own
MOST_CLAUSES = 8
COMMANDS: list[dict[str, str]] = [
    {"color": grey, "linestyle": style} for style in ("-", "--", ":") for grey in ("0.0", "0.35", "0.6")
]


def draw_strips(run: Run, policy: Policy, path: Path) -> None:
    """Draws `strips_figure` as path.png and path.pdf; `path` is without suffix."""
    with own_style():
        save(strips_figure(run, policy), path)


def strips_figure(run: Run, policy: Policy) -> Figure:
    """The noise-free motion over time: stretches of its path, if there is one, commands, and the clauses so far.

    Args:
      run: what was learned.
      policy: learned by it.
    """
    task = make_task(run.task)
    motion = watch(task, run.spec, policy, simulator_of(task))
    views = [] if motion.path is None else views_of(motion.path)
    clauses = dict(list(motion.clauses.items())[:MOST_CLAUSES])
    with own_style():
        heights = [*[1.5] * len(views), 1.1, *[0.75] * len(clauses)]
        figure = Figure(figsize=(WIDTH, sum(heights) + 1.6), layout="constrained")
        rows = figure.add_gridspec(len(heights), 1, height_ratios=heights)
        for i, view in enumerate(views):
            cells = rows[i].subgridspec(1, STRETCHES)
            _draw_stretches([figure.add_subplot(cells[k]) for k in range(STRETCHES)], motion, view)
        strips = [figure.add_subplot(rows[i]) for i in range(len(views), len(heights))]
        _draw_commands(strips[0], task, motion)
        for axes, (text, watched) in zip(strips[1:], clauses.items(), strict=True):
            _draw_clause(axes, text, watched, motion)
        for axes in strips:
            axes.set_xlim(0.0, float(motion.times[-1]) or 1.0)
            axes.axvline(motion.times[motion.why.step], color="#D55E00", linewidth=1.4, linestyle=(0, (1, 1.5)))
            axes.spines[["top", "right"]].set_visible(False)
            axes.tick_params(labelbottom=axes is strips[-1], labelsize=7)
        strips[-1].set_xlabel("time (s)")
        figure.suptitle(title_of(task, run), fontsize=10)
        figure.supxlabel(_caption(motion, len(motion.clauses) - len(clauses)), fontsize=7.5)
    return figure


def _caption(motion: Motion, left_out: int) -> str:
    why = motion.why
    text = f"Robustness of the mean motion {why.value:+.3f}, decided {why.decided_by}: dotted, "
    text += f"at {motion.times[why.step]:.4g} s. "
    if motion.path is not None:
        text += "Above, the path in stretches (dot: begin, square: end), the rest in grey. "
    if motion.clauses:
        text += (
            "Each clause of the spec: black, its robustness if the motion ended then; grey, what it stays between "
            "however the motion goes on; the number is that of the whole motion."
        )
    else:
        text += "The spec cannot be monitored, so that there is nothing to tell of its clauses before the end."
    return "\n".join(textwrap.wrap(f"{text}{f' {left_out} more clauses are left out.' if left_out else ''}", 108))


def _draw_stretches(cells: Sequence[Axes], motion: Motion, view: tuple[int, int]) -> None:
    """Draws stretches of the motion of equal duration, one picture each, with the rest of the path in grey."""
    assert motion.path is not None
    path = motion.path[:, view]
    bounds = np.linspace(0, len(path) - 1, len(cells) + 1).astype(int)
    for axes, start, stop in zip(cells, bounds, bounds[1:], strict=False):
        draw_regions(axes, motion.regions, view)
        axes.plot(*path.T, color="0.85", linewidth=0.6, zorder=2)
        draw_path(axes, path, int(start), int(stop), 1.1)
        axes.plot(*path[start], "o", color=TIME(start / (len(path) - 1 or 1)), markersize=3.5, zorder=6)
        axes.plot(*path[stop], "s", color="black", markersize=3.5, zorder=6)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.05)
        axes.tick_params(left=False, bottom=False, labelleft=False, labelbottom=False)
        axes.set_title(f"{motion.times[start]:.4g} to {motion.times[stop]:.4g} s", fontsize=8)


def _draw_commands(axes: Axes, task: Task, motion: Motion) -> None:
    names = [part for group in task.action for part in group.parts]
    for i, (name, values) in enumerate(zip(names, (motion.commands / task.command_scale).T, strict=True)):
        axes.plot(motion.times, values, linewidth=0.8, label=f" {name}", **COMMANDS[i % len(COMMANDS)])  # type: ignore[arg-type]
    for limit in (-1.0, 1.0):
        axes.axhline(limit, color="0.4", linewidth=0.7, linestyle="--")
    axes.set_title("commands as sent, as a share of a full one (dashed)", fontsize=8, loc="left")
    columns = 1 if len(names) <= 4 else 2
    axes.legend(
        loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False, ncols=columns, handlelength=1.4
    )


def _draw_clause(axes: Axes, text: str, watched: Watched, motion: Motion) -> None:
    now = np.where(np.isfinite(watched.now), watched.now, np.nan)
    known = np.append(now[np.isfinite(now)], 0.0)
    margin = 0.12 * (np.ptp(known) or 1.0)
    low, high = known.min() - margin, known.max() + margin
    axes.fill_between(
        motion.times, np.clip(watched.lower, low, high), np.clip(watched.upper, low, high), color="0.85", linewidth=0
    )
    axes.plot(motion.times, now, color="black", linewidth=1.2)
    axes.axhline(0.0, color="0.4", linewidth=0.7, linestyle="--")
    axes.set_ylim(low, high)
    shown = text if len(text) <= 80 else f"{text[:79]}…"
    axes.set_title(f"{shown}: {watched.now[-1]:+.3g}", fontsize=8, loc="left", family="monospace")
