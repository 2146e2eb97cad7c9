"""Time-varying linear-Gaussian policy (case study, section 3.3.3): u_t = K s_t + k_t + noise, noise ~ N(0, Sigma_t).

K is a manually tuned gain and stays fixed; (k_t, Sigma_t) are learned. Since the noise does not depend on the state,
the part k_t + noise of every command, its *offset*, can be drawn before the trajectory is simulated, and it is what
policy search learns from: delta_t = u_t - K s_t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Policy:
    """u_t = gain s_t + mean_t + noise_t for T time steps, n features and d commands.

    Attributes:
      gain: K, shape (d, n); the same at every step.
      mean: k_t, shape (T, d), in the commands' unit.
      covariance: Sigma_t of the exploration noise, shape (T, d, d).
      correlation: width in steps of the noise's correlation over time; 0 for independent steps (as published).
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
        """Entropy of the offsets of one step, averaged over the steps, nats; the correlation is left out."""
        d = self.mean.shape[1]
        return float(np.mean(0.5 * (d * np.log(2 * np.pi * np.e) + np.linalg.slogdet(self.covariance)[1])))


def correlated_noise(shape: tuple[int, int, int], width: float, rng: np.random.Generator) -> Array:
    """Standard normal noise of shape (N, T, d), smoothed along T by a Gaussian of `width` steps.

    Every entry keeps unit variance; samples tau steps apart correlate as exp(-tau^2 / (4 width^2)),
    for a width of a step or more (a narrower kernel is sampled too coarsely for the formula).
    """
    if width == 0:
        return rng.standard_normal(shape)

    from scipy.ndimage import convolve1d  # a command that only tells a mistake need not wait for it

    count, steps, d = shape
    reach = int(np.ceil(4 * width))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    white = rng.standard_normal((count, steps + 2 * reach, d))
    smooth = convolve1d(white, kernel / np.linalg.norm(kernel), axis=1, mode="constant")
    return np.asarray(smooth[:, reach : reach + steps])


def shaped(noise: Array, covariance: Array) -> Array:
    """Noise of covariance Sigma_t (T, d, d), also a singular one, from standard normal noise (N, T, d)."""
    variances = np.diagonal(covariance, axis1=1, axis2=2)
    if np.count_nonzero(covariance) == np.count_nonzero(variances):  # diagonal, as the damped fit leaves it
        return np.asarray(np.sqrt(variances) * noise)
    values, vectors = np.linalg.eigh(covariance)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return np.asarray(np.einsum("tij,ntj->nti", roots, noise))
