"""What every learner promises, those of installed packages included."""

import dataclasses
import io

import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.learning.policy import Policy
from tltlrl.learning.reps import EpisodeBased, RepsSettings
from tltlrl.learning.scores import Scores
from tltlrl.registry import LEARNERS
from tltlrl.training.states import arrays_of, from_arrays

SAMPLES, STEPS, D = 20, 6, 2
SLOPE = np.random.default_rng(99).standard_normal((STEPS, D))


def policy():
    return Policy(np.zeros((D, 3)), np.zeros((STEPS, D)), np.tile(np.eye(D), (STEPS, 1, 1)), correlation=1.0)


@pytest.fixture(params=LEARNERS.names())
def learner(request):
    kind = LEARNERS.get(request.param)
    return kind(kind.Settings(), SAMPLES)


def linear(offsets):
    """A return that is linear in the offsets, known per step, too."""
    rewards = np.sum(offsets * SLOPE, axis=2)
    return Scores(rewards.sum(axis=1), rewards)


def learned(learner, iterations, state=None, first=0, seed=3):
    state = learner.start(policy()) if state is None else state
    told = []
    for i in range(first, iterations):
        offsets = learner.ask(state, SAMPLES, np.random.default_rng([seed, i]))
        assert offsets.shape == (SAMPLES, STEPS, D)
        state, diagnostics = learner.tell(state, offsets, linear(offsets))
        told.append(diagnostics)
    return state, told


def same(a, b):
    return all(x.tobytes() == y.tobytes() for x, y in zip(arrays_of(a).values(), arrays_of(b).values(), strict=True))


def test_same_seed_same_bytes(learner):
    (one, told_one), (other, told_other) = learned(learner, 5), learned(learner, 5)
    assert same(one, other)
    assert told_one == told_other


def test_the_state_is_a_frozen_dataclass_that_survives_writing_and_reading(learner):
    state, _ = learned(learner, 2)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(state, dataclasses.fields(state)[0].name, None)
    file = io.BytesIO()
    np.savez(file, **arrays_of(state))
    file.seek(0)
    with np.load(file, allow_pickle=False) as saved:
        again = from_arrays(learner.start(policy()), {name: saved[name] for name in saved.files})
    assert same(state, again)


@pytest.mark.parametrize("stopped_after", [0, 1, 4])
def test_it_resumes_from_any_state_to_the_same_bytes(learner, stopped_after):
    undisturbed, _ = learned(learner, 5)
    stopped, _ = learned(learner, stopped_after)
    kind = type(learner)
    fresh = kind(kind.Settings(), SAMPLES)  # a learner has no state of its own
    resumed, _ = learned(fresh, 5, state=from_arrays(fresh.start(policy()), arrays_of(stopped)), first=stopped_after)
    assert same(undisturbed, resumed)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_return_of_nan_or_infinity_is_told(learner, wrong):
    state = learner.start(policy())
    offsets = learner.ask(state, SAMPLES, np.random.default_rng(0))
    scores = linear(offsets)
    scores.returns[4] = scores.rewards[4, 2] = wrong
    with pytest.raises(ValueError, match="4"):
        learner.tell(state, offsets, scores)


def test_samples_that_cannot_be_worse_are_not_followed(learner):
    state = learner.start(policy())
    offsets = learner.ask(state, SAMPLES, np.random.default_rng(0))
    scores = linear(offsets)
    scores.returns[:5] = -np.inf
    scores.rewards[:5] = -np.inf
    state, _ = learner.tell(state, offsets, scores)
    assert np.isfinite(learner.policy(state).mean).all()


@pytest.mark.parametrize("seed", range(3))
def test_the_mean_of_a_linear_return_rises(learner, seed):
    state, _ = learned(learner, 8, seed=seed)
    assert np.sum(learner.policy(state).mean * SLOPE) > 1.0  # the first policy's is 0


def test_the_first_policy_is_handed_back_and_keeps_its_gain(learner):
    first = policy()
    assert same(learner.policy(learner.start(first)), first)
    state, _ = learned(learner, 3)
    np.testing.assert_array_equal(learner.policy(state).gain, first.gain)


def test_diagnostics_are_numbers_under_the_same_names_every_time(learner):
    _, told = learned(learner, 3)
    assert all(type(value) is float for diagnostics in told for value in diagnostics.values())
    assert len({tuple(diagnostics) for diagnostics in told}) == 1


def test_every_setting_has_a_default_and_a_meaning(learner):
    for field in dataclasses.fields(type(learner).Settings):
        assert field.metadata["setting"].meaning


def test_a_bound_that_weights_of_the_samples_cannot_reach_is_refused_by_name():
    with pytest.raises(UserError, match=r"algorithm\.epsilon: 3.0 must lie between 0 and log\(algorithm\.samples\)"):
        EpisodeBased(RepsSettings(epsilon=3.0), SAMPLES)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"epsilon": 0.0}, "algorithm.epsilon: 0.0 is too small; it must be above 0"),
        ({"kept": 1.0}, "algorithm.kept: 1.0 is too large; it must be below 1"),
        ({"covariance": "dampd"}, "algorithm.covariance: there is no dampd; did you mean damped?"),
        ({"epsilon": float("nan")}, "algorithm.epsilon: nan is not a finite number"),
    ],
)
def test_wrong_settings_are_refused_wherever_they_are_made(values, message):
    with pytest.raises(UserError) as error:
        RepsSettings(**values)
    assert str(error.value) == message
