"""A motion, and the robustness of each clause while it runs, for pictures and films."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tltlrl.learning.policy import Policy
from tltlrl.logic import Explanation, Region, Spec, SpecError
from tltlrl.simulation.simulator import Simulates
from tltlrl.simulation.trials import mean_motion
from tltlrl.tasks.task import Signals, Task

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Watched:
    """One clause while a motion runs; each of shape (T,).

    Attributes:
      now: its robustness if the motion ended with this sample.
      lower, upper: bounds on its robustness, however the motion goes on.
    """

    now: Array
    lower: Array
    upper: Array


@dataclass(frozen=True)
class Motion:
    """The noise-free motion of a policy, T samples.

    Attributes:
      times: s, (T,).
      features, commands: (T, n), (T, d).
      path: path of the point that the spec's regions are about, or of the end-effector, m, (T, 2 or 3), or None.
      regions: the spec's regions about this point.
      clauses: text => clause; empty if the spec cannot be monitored.
      why: what decides its robustness.
    """

    times: Array
    features: Array
    commands: Array
    path: Array | None
    regions: tuple[Region, ...]
    clauses: Mapping[str, Watched]
    why: Explanation


def watch(task: Task, spec: Spec, policy: Policy, simulator: Simulates) -> Motion:
    """The motion of the mean policy without noise, up to where the episode ends.

    Args:
      task: what is simulated.
      spec: the spec, with the task's control timestep as its period.
      policy: the policy that moves.
      simulator: simulator of the task.
    """
    motion = mean_motion(simulator, policy)
    length = int(motion.lengths[0])
    features, commands = motion.features[:, :length], motion.commands[:, :length]
    signals = task.signals(features, commands)
    return Motion(
        task.control_timestep * np.arange(length, dtype=np.float64),
        features[0],
        commands[0],
        path_of(task, spec, features, signals)[0] if has_path(task, spec) else None,
        tuple(region for region in spec.regions if region.signal == _place(spec)),
        watch_clauses(spec, signals),
        spec.explain(signals)[0],
    )


def watch_clauses(spec: Spec, signals: Signals) -> dict[str, Watched]:
    """Follows each clause over one trajectory, signals (1, T) or (1, T, k); empty if the spec cannot be monitored."""
    try:
        monitors = spec.monitors()
    except SpecError:
        return {}
    own = {name: np.asarray(signals[name]) for name in spec.signals}
    steps = next(iter(own.values())).shape[1]
    samples = [{name: values[:, t] for name, values in own.items()} for t in range(steps)]
    watched = {}
    for text, monitor in monitors.items():
        readings = [monitor.update(sample) for sample in samples]
        rows = np.array([(each.robustness[0], each.lower[0], each.upper[0]) for each in readings])
        watched[text] = Watched(*rows.T)
    return watched


def has_path(task: Task, spec: Spec) -> bool:
    """Whether there is a point whose path can be drawn."""
    return _place(spec) is not None or task.end_effector is not None


def path_of(task: Task, spec: Spec, features: Array, signals: Signals) -> Array:
    """The path of the point to draw, in N trajectories: features (N, T, n) => (N, T, 2 or 3), m."""
    if (place := _place(spec)) is not None:
        return np.asarray(signals[place])
    assert task.end_effector is not None
    return features[..., task.slices[task.end_effector]]


def _place(spec: Spec) -> str | None:
    """The signal that most regions are about."""
    found = Counter(
        region.signal
        for region in spec.regions
        if region.signal is not None and len(region.centre or region.lower or ()) in (2, 3)
    )
    return found.most_common(1)[0][0] if found else None


def entries(region: Region, path: Array) -> list[int]:
    """The samples with which a path, (T, 2 or 3), enters a region; 0 where it begins in it."""
    if region.centre is not None:
        assert region.radius is not None
        within = np.linalg.norm(path - np.array(region.centre), axis=1) < region.radius
    else:
        within = np.all((path > np.array(region.lower)) & (path < np.array(region.upper)), axis=1)
    before = np.concatenate([[False], within[:-1]])
    return [int(step) for step in np.flatnonzero(within & ~before)]
