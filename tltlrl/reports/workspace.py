"""A picture of the planar workspace: arm, regions of the spec, sampled paths and the mean path."""

from __future__ import annotations

from copy import copy
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, Rectangle

from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec
from tltlrl.reports.plotting import FONT, LABELS, save
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.training.build import make_task
from tltlrl.training.study import Run

POSES = 6  # of the arm, evenly spread over the motion


def draw_workspace(run: Run, policy: Policy, path: Path, count: int = 20) -> None:
    """The learned motion in the plane, as path.png and path.pdf; `path` is without suffix. See `workspace_figure`."""
    with mpl.rc_context(FONT):
        save(workspace_figure(run, policy, count), path)


def workspace_figure(run: Run, policy: Policy, count: int = 20) -> Figure:
    """The learned motion in the plane.

    Args:
      run: of a task that has a skeleton.
      policy: learned by the run.
      count: sampled paths, with the policy's remaining exploration and the actuators' noise.
    """
    task = make_task(run.task)
    assert task.skeleton is not None
    simulator = Simulator(task)
    rng = np.random.default_rng([run.seed, run.algorithm.iterations])
    sampled = simulator.rollout(policy.gain, policy.sample(count, rng), simulator.draw_command_noise(count, rng))
    motion = mean_motion(simulator, policy)
    signals = task.signals(motion.features, motion.commands)
    robustness = run.spec.robustness(signals, motion.lengths)[0]

    with mpl.rc_context(FONT):
        figure = Figure(figsize=(4.8, 4.2), layout="constrained")
        axes = figure.add_subplot()
        _draw_regions(axes, run.spec)
        for ee in task.skeleton(sampled.features)[..., -1, :]:
            axes.plot(*ee.T, color="0.6", linewidth=0.3, zorder=2)
        ee = task.skeleton(motion.features[0])[:, -1]
        axes.plot(*ee.T, color="black", linewidth=0.8, zorder=4)
        axes.plot(*ee[0], "o", color="black", markersize=5, zorder=6)
        axes.plot(*ee[-1], "s", color="black", markeredgecolor="white", markersize=6, zorder=6)
        for i in np.linspace(0, task.steps - 1, POSES).astype(int):
            joints = task.skeleton(motion.features[0, i])
            axes.plot(*joints.T, "-o", color="#0072B2", alpha=0.15 + 0.6 * i / task.steps, markersize=2, zorder=3)
        axes.set_aspect("equal", adjustable="datalim")  # every picture fills the same frame
        axes.set_xlabel("x (m)")
        axes.set_ylabel("y (m)")
        axes.set_title(f"{task.name}: {LABELS.get(run.case.name, run.case.name)}, seed {run.seed}")
        figure.supxlabel(
            f"Robustness of the mean motion {robustness:+.3f}. Black: mean path of the end-effector (dot: start,\n"
            f"square: end); grey: {count} paths sampled from the learned policy "
            f"(seed [{run.seed}, {run.algorithm.iterations}]).\n"
            f"Blue: {POSES} poses of the arm, later ones darker. Plain: to be in; hatched: to be kept out of.",
            fontsize=6.5,
        )
    return figure


def _draw_regions(axes: Axes, spec: Spec) -> None:
    """Every ball and box that the spec speaks of in the plane, with its name."""
    for region in spec.regions:
        if region.signal != "ee":
            continue
        if region.centre is not None:
            x, y = region.centre
            shape: Patch = Circle((x, y), region.radius or 0.0)
        else:
            assert region.lower is not None
            assert region.upper is not None
            (left, bottom), (right, top) = region.lower, region.upper
            x, y = (left + right) / 2, (bottom + top) / 2
            shape = Rectangle((left, bottom), right - left, top - bottom)
        shape.set(facecolor="0.9", edgecolor="0.3", linewidth=0.8, hatch=None if region.inside else "////", zorder=1)
        axes.add_patch(shape)
        outline = copy(shape)  # above the paths, which may cover all of a small region
        outline.set(fill=False, hatch=None, zorder=5)
        axes.add_patch(outline)
        if region.inside:
            axes.annotate(
                region.name or "", (x, y), xytext=(0, -14), textcoords="offset points", ha="center", va="top",
                fontsize=7, zorder=5.5, bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
            )  # fmt: skip
