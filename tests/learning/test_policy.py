import numpy as np
import pytest

from tltlrl.learning.policy import Policy, correlated_noise, shaped


def test_samples_have_the_policys_mean_and_covariance():
    rng = np.random.default_rng(0)
    factor = rng.normal(size=(4, 3, 3))
    policy = Policy(np.zeros((3, 2)), rng.normal(size=(4, 3)), factor @ factor.transpose(0, 2, 1))
    offsets = policy.sample(200_000, rng)
    np.testing.assert_allclose(offsets.mean(axis=0), policy.mean, atol=0.03)
    for t in range(4):
        np.testing.assert_allclose(np.cov(offsets[:, t].T), policy.covariance[t], atol=0.1)


def test_same_generator_state_same_samples():
    policy = Policy(np.zeros((3, 2)), np.zeros((4, 3)), np.tile(np.eye(3), (4, 1, 1)), correlation=2.0)
    first, second = (policy.sample(5, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("width", [1.0, 2.0, 4.0])
def test_correlated_noise_has_unit_variance_and_the_stated_correlation(width):
    noise = correlated_noise((20_000, 40, 1), width, np.random.default_rng(1))[:, :, 0]
    np.testing.assert_allclose(noise.var(axis=0), 1.0, atol=0.05)
    for lag in (1, 3, 6):
        expected = np.exp(-(lag**2) / (4 * width**2))
        found = np.mean(noise[:, lag:] * noise[:, :-lag])
        np.testing.assert_allclose(found, expected, atol=0.02)


def test_noise_takes_singular_and_zero_covariances():
    singular = np.array([[[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]], np.zeros((3, 3))])
    basis = shaped(np.tile(np.eye(3)[:, None], (1, 2, 1)), singular)  # (3, T, 3): the rows of a root of each step
    np.testing.assert_allclose(np.einsum("kti,ktj->tij", basis, basis), singular, atol=1e-12)


def test_diagonal_covariances_scale_each_command():
    noise = np.random.default_rng(0).standard_normal((5, 2, 3))
    variances = np.array([[1.0, 4.0, 0.0], [9.0, 0.25, 1.0]])
    found = shaped(noise, variances[:, :, None] * np.eye(3))
    np.testing.assert_array_equal(found, noise * np.sqrt(variances))


def test_entropy_is_the_gaussians():
    policy = Policy(np.zeros((2, 1)), np.zeros((3, 2)), np.tile(np.diag([4.0, 9.0]), (3, 1, 1)))
    np.testing.assert_allclose(policy.entropy(), np.log(2 * np.pi * np.e) + np.log(6.0))
