"""Potentials of running trajectories whose last value is the robustness, for rewards at every step.

The rewards r_t = Phi_t - Phi_{t-1} sum to Phi_{T-1}, whatever Phi is in between, so they make no policy better or
worse. Phi has to be finite; here infinities count as -FLOOR and FLOOR. The robustness of the trajectory so far would be
a poor potential: it is -inf as long as a strong obligation is open, and shows nothing of a second goal before the
first. Two potentials are better, each for a kind of learner.

`stages` measures how far a trajectory has come. For each conjunct,

    Phi_t = rho_t + sum over d >= 1 of min(0, best_t(d)),  best_t(d) = max of alpha_t over states at most d from the end

where a state's distance from the end is the fewest guards on a way there. As the trajectory nears a goal, the value of
the stage behind it grows, up to 0 at the goal. It does not drop when the automaton turns to the next goal, because
alpha keeps the best of the past. So it rewards a learner at every step for progress.

`hope` is min(0, upper bound): 0 as long as the spec can still be satisfied. It falls at the step that
spoils this, by as much as is lost. The reward-to-go from step t is the robustness less what was lost before. It has
little noise, which suits learners that weigh rewards-to-go, such as step-based REPS. docs/online.md has measurements.
"""

from collections.abc import Callable

import numpy as np

from tltlrl.logic.graph import Array
from tltlrl.logic.online.monitor import Monitor, Reading
from tltlrl.logic.online.pursuit import Quick

FLOOR = 10.0  # in the predicates' unit

Potential = Callable[[Monitor, Reading], Array]


def hope(_: Monitor, reading: Reading) -> Array:
    """The potential min(0, upper bound of the robustness), (N,); 0 while the spec can still be satisfied."""
    return finite(np.minimum(reading.upper, 0.0))


def stages(monitor: Monitor, reading: Reading) -> Array:
    """The potential of how far the trajectories have come, (N,).

    Args:
      monitor: the monitor after its last update.
      reading: the result of that update.
    """
    phi = finite(reading.robustness)
    for pursuit in monitor.pursuits:
        if isinstance(pursuit, Quick):
            best = pursuit.together.nearing.fold(np.maximum, pursuit.alpha)
            for stage in np.minimum(finite(best), 0.0):
                phi = phi + stage
    return phi


def finite(values: Array) -> Array:
    """The values, with -FLOOR and FLOOR in place of infinities."""
    return np.where(np.isinf(values), np.copysign(FLOOR, values), values)  # a tenth of the time of nan_to_num
