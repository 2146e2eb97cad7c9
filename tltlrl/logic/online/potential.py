"""Potentials of running trajectories whose last value is the robustness, for rewards at every step.

r_t = Phi_t - Phi_{t-1} sums to Phi_{T-1}, whatever Phi is in between: no policy becomes better or worse by it. Phi has
to be finite (here infinities count as -FLOOR and FLOOR), and robustness-if-it-ended-now is a poor one: -inf as long as
anything strong is owed, and nothing to say of a second goal before the first. Two that are better, for two kinds of
learners:

`stages` says how far a trajectory has come. Of each conjunct,

    Phi_t = rho_t + sum over d >= 1 of min(0, best_t(d)),  best_t(d) = max of alpha_t over states at most d from the end

where a state's distance from the end is the fewest guards that have still to be passed. As a goal comes nearer, the
stage behind it grows, and it is 0 when the goal is reached; nothing drops when an automaton goes on to the next goal,
for alpha keeps the best of the past. It tells a learner at every step where to go.

`hope` is min(0, upper bound): 0 as long as the spec can still be satisfied. It falls at the step that spoils this, and
by how much. The return from step t on, which is the robustness less what was spoilt before, has little noise for a
learner that weighs whole returns, as step-based REPS does. docs/online.md shows what was measured.
"""

from collections.abc import Callable

import numpy as np

from tltlrl.logic.graph import Array
from tltlrl.logic.online.monitor import Monitor, Reading
from tltlrl.logic.online.pursuit import Quick

FLOOR = 10.0  # in the predicates' unit

Potential = Callable[[Monitor, Reading], Array]


def hope(_: Monitor, reading: Reading) -> Array:
    """By how much the trajectories' robustness will at least be below 0, (N,); 0 if it need not be."""
    return finite(np.minimum(reading.upper, 0.0))


def stages(monitor: Monitor, reading: Reading) -> Array:
    """How far the trajectories have come, (N,).

    Args:
      monitor: after its last update.
      reading: of that update.
    """
    phi = finite(reading.robustness)
    for pursuit in monitor.pursuits:
        if isinstance(pursuit, Quick):
            best = pursuit.together.nearing.fold(np.maximum, pursuit.alpha)
            for stage in np.minimum(finite(best), 0.0):
                phi = phi + stage
    return phi


def finite(values: Array) -> Array:
    """The values, an infinite one as -FLOOR or FLOOR."""
    return np.where(np.isinf(values), np.copysign(FLOOR, values), values)  # a tenth of the time of nan_to_num
