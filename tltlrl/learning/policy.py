"""Time-varying linear-Gaussian policy (case study, section 3.3.3): u_t = K s_t + k_t + noise, noise ~ N(0, Sigma_t).

K is a manually tuned gain and stays fixed; (k_t, Sigma_t) are learned. The *offset* of a
command is delta_t = u_t - K s_t = k_t + noise. It does not depend on the state, so offsets are drawn before the
trajectory is simulated. Policy search learns from offsets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Policy:
    """A policy u_t = gain s_t + mean_t + noise_t for T time steps, n features and d commands.

    Attributes:
      gain: K, shape (d, n); the same at every step.
      mean: k_t, shape (T, d), in the commands' unit.
      covariance: Sigma_t of the exploration noise, shape (T, d, d).
      correlation: width of the noise's correlation over time, in steps; 0 for independent steps (as published).
    """

    gain: Array
    mean: Array
    covariance: Array
    correlation: float = 0.0

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Offsets k_t + noise_t of `count` trajectories, shape (count, T, d)."""
        noise = correlated_noise((count, *self.mean.shape), self.correlation, rng)
        return self.mean + shaped(noise, self.covariance)

    def entropy(self) -> float:
        """Entropy of the offsets of one step, averaged over the steps, nats; the correlation does not count."""
        d = self.mean.shape[1]
        return float(np.mean(0.5 * (d * np.log(2 * np.pi * np.e) + np.linalg.slogdet(self.covariance)[1])))


def correlated_noise(shape: tuple[int, int, int], width: float, rng: np.random.Generator) -> Array:
    """Standard normal noise of shape (N, T, d), smoothed along T by a Gaussian of `width` steps.

    Every entry keeps unit variance; samples tau steps apart correlate as exp(-tau^2 / (4 width^2)),
    for a width of a step or more (a narrower kernel is sampled too coarsely for the formula).
    """
    if width == 0:
        return rng.standard_normal(shape)

    from scipy.ndimage import convolve1d  # slow to import; a command that only reports a mistake does without

    count, steps, d = shape
    reach = int(np.ceil(4 * width))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    white = rng.standard_normal((count, steps + 2 * reach, d))
    smooth = convolve1d(white, kernel / np.linalg.norm(kernel), axis=1, mode="constant")
    return np.asarray(smooth[:, reach : reach + steps])


def shaped(noise: Array, covariance: Array) -> Array:
    """Standard normal noise (N, T, d), given the covariance Sigma_t (T, d, d), which may be singular."""
    variances = np.diagonal(covariance, axis1=1, axis2=2)
    if np.count_nonzero(covariance) == np.count_nonzero(variances):  # diagonal, as after the damped fit
        return np.asarray(np.sqrt(variances) * noise)
    values, vectors = np.linalg.eigh(covariance)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return np.asarray(np.einsum("tij,ntj->nti", roots, noise))
