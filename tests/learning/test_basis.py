"""Basis functions as a parameterisation of any learner."""

import numpy as np
import pytest

from tltlrl.learning.basis import Basis, radial_basis
from tltlrl.learning.policy import Policy
from tltlrl.learning.reps import EpisodeBased, RepsSettings
from tltlrl.learning.scores import Scores

STEPS, FUNCTIONS, SAMPLES = 40, 5, 20


def policy():
    mean = np.random.default_rng(0).normal(size=(STEPS, 2))
    return Policy(np.ones((2, 3)), mean, np.tile(np.diag([0.25, 4.0]), (STEPS, 1, 1)))


@pytest.fixture
def learner():
    return Basis(EpisodeBased(RepsSettings(), SAMPLES), FUNCTIONS)


def test_the_functions_sum_to_one_at_every_step_and_each_has_its_turn():
    basis = radial_basis(STEPS, FUNCTIONS)
    np.testing.assert_allclose(basis.sum(axis=1), 1.0)
    assert basis.argmax(axis=1).tolist() == sorted(basis.argmax(axis=1))
    assert set(basis.argmax(axis=1)) == set(range(FUNCTIONS))


def test_it_starts_at_the_first_policy_and_explores_as_widely(learner):
    state = learner.start(policy())
    np.testing.assert_array_equal(learner.policy(state).mean, policy().mean)
    offsets = learner.ask(state, 20_000, np.random.default_rng(0)) - policy().mean
    np.testing.assert_allclose(np.mean(offsets**2, axis=(0, 1)), [0.25, 4.0], rtol=0.03)
    variances = np.diagonal(learner.policy(state).covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(offsets.var(axis=0), variances, rtol=0.1)


def test_every_offset_is_made_of_the_functions(learner):
    state = learner.start(policy())
    offsets = learner.ask(state, 7, np.random.default_rng(0)) - policy().mean
    basis = radial_basis(STEPS, FUNCTIONS)
    weights = np.linalg.lstsq(basis, offsets.transpose(1, 0, 2).reshape(STEPS, -1), rcond=None)[0]
    np.testing.assert_allclose((basis @ weights).reshape(STEPS, 7, 2).transpose(1, 0, 2), offsets, atol=1e-12)


def test_its_learner_is_told_of_the_weights_that_it_asked_for(learner):
    """The mean is that of the same learner on the weights themselves."""
    state, rng = learner.start(policy()), np.random.default_rng(1)
    inner = EpisodeBased(RepsSettings(), SAMPLES)
    weights = inner.ask(state.weights, SAMPLES, np.random.default_rng(1))
    offsets = learner.ask(state, SAMPLES, rng)
    returns = np.random.default_rng(2).normal(size=SAMPLES)
    state, _ = learner.tell(state, offsets, Scores(returns))
    expected, _ = inner.tell(learner.start(policy()).weights, weights, Scores(returns))
    np.testing.assert_allclose(state.weights.mean, expected.mean, atol=1e-9)


def test_it_learns_a_smooth_motion(learner):
    goal = np.sin(np.linspace(0, 3, STEPS))[:, None]
    state = learner.start(policy())
    for i in range(80):
        offsets = learner.ask(state, SAMPLES, np.random.default_rng(i))
        returns = -np.sum((offsets - policy().mean - goal) ** 2, axis=(1, 2))
        state, _ = learner.tell(state, offsets, Scores(returns))
    assert np.abs(learner.policy(state).mean - policy().mean - goal).max() < 0.2
