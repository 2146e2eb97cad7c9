"""CMA-ES: on functions with a known optimum, and what it refuses. The contract of every learner: test_learners.py."""

import sys

import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.learning.basis import Basis
from tltlrl.learning.cma import CmaEs, CmaSettings
from tltlrl.learning.policy import Policy
from tltlrl.learning.scores import Scores


def policy(steps, d=2):
    return Policy(np.zeros((d, 3)), np.zeros((steps, d)), np.tile(np.diag([0.25, 4.0])[:d, :d], (steps, 1, 1)))


def test_it_starts_with_the_first_policys_noise():
    learner = CmaEs(CmaSettings(), 20)
    state = learner.start(policy(5))
    offsets = learner.ask(state, 20_000, np.random.default_rng(0))
    np.testing.assert_allclose(offsets.var(axis=(0, 1)), [0.25, 4.0], rtol=0.03)
    np.testing.assert_array_equal(learner.policy(state).covariance, policy(5).covariance)


def test_it_learns_the_covariance_of_an_ill_conditioned_quadratic():
    """Offsets of different steps depend on each other; 1e4 is the condition number."""
    learner, rng = CmaEs(CmaSettings(), 12), np.random.default_rng(0)
    turn = np.linalg.qr(rng.normal(size=(8, 8)))[0]
    curvature = turn @ np.diag(np.logspace(0, 4, 8)) @ turn.T
    state = learner.start(policy(4))
    for _ in range(250):
        offsets = learner.ask(state, 12, rng)
        x = offsets.reshape(12, -1) - 1.0
        state, told = learner.tell(state, offsets, Scores(-np.einsum("ni,ij,nj->n", x, curvature, x)))
    np.testing.assert_allclose(learner.policy(state).mean, 1.0, atol=1e-3)
    assert told["condition_number"] > 1e3


def test_a_motion_has_too_many_offsets_and_basis_functions_have_not():
    learner = CmaEs(CmaSettings(), 12)
    with pytest.raises(UserError, match=r"algorithm\.basis: .* all 400 offsets .* algorithm\.basis=20"):
        learner.start(policy(200))
    assert Basis(learner, 20).start(policy(200)).weights.mean.shape == (40,)


def test_without_pycma_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "cma.more_algorithms", None)
    with pytest.raises(UserError, match=r"pip install 'tltlrl\[cma\]'"):
        CmaEs(CmaSettings(), 12)
