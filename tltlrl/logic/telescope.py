"""Divides the robustness of whole trajectories into rewards per step."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from tltlrl.logic.graph import Array
from tltlrl.logic.online.potential import Potential, finite, hope
from tltlrl.logic.spec import Spec


def telescope(
    spec: Spec,
    signals: Mapping[str, ArrayLike],
    lengths: ArrayLike | None = None,
    phi: Potential = hope,
) -> Array:
    """Rewards r_t = Phi_t - Phi_{t-1} of whole trajectories, with Phi_{-1} = 0: they sum to the robustness.

    Args:
      spec: of the robustness.
      signals, lengths: as for `Spec.robustness`.
      phi: the potential of a trajectory that still runs.

    Returns:
      (N, T), 0 from a trajectory's length on.

    Raises:
      TraceError: as in `Spec.robustness`.
    """
    last = finite(spec.robustness(signals, lengths))
    arrays = {name: np.asarray(signals[name], dtype=np.float64) for name in spec.signals}
    count, steps = next(iter(arrays.values())).shape[:2]
    ends = np.full(count, steps) if lengths is None else np.asarray(lengths)
    values = np.empty((count, steps))
    monitor = spec.monitor(count)
    for t in range(steps):
        at = np.minimum(t, ends - 1)
        reading = monitor.update({name: array[np.arange(count), at] for name, array in arrays.items()})
        values[:, t] = np.where(t < ends - 1, phi(monitor, reading), last)
    return np.diff(values, axis=1, prepend=0.0)
