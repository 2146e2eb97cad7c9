"""The update: against the formulas written as loops, step-based against episode-based, and on a quadratic."""

import numpy as np
import pytest

from tltlrl.learning.policy import Policy
from tltlrl.learning.reps import EpisodeBased, RepsSettings, StepBased, fit, reward_to_go, solve_dual
from tltlrl.learning.scores import Scores


def problem(n=12, steps=5, d=3, seed=0):
    rng = np.random.default_rng(seed)
    mean, covariance = rng.normal(size=(steps, d)), np.tile(np.diag([1.0, 2.0, 0.5])[:d, :d], (steps, 1, 1))
    offsets = mean + rng.normal(size=(n, steps, d))
    return rng, mean, covariance, offsets


def updated(kind, offsets, scores, mean, covariance, epsilon=0.5, rule="damped", kept=0.5):
    """The learner's next policy from these samples of the one with this mean and covariance."""
    policy = Policy(np.zeros((mean.shape[1], 1)), mean, covariance)
    learner = kind(RepsSettings(epsilon, rule, kept), len(offsets))
    return learner.tell(learner.start(policy), offsets, scores)[0]


def test_published_fit_is_the_weighted_maximum_likelihood_of_every_step():
    rng, mean, covariance, offsets = problem()
    returns = rng.normal(size=12)
    update = updated(EpisodeBased, offsets, Scores(returns), mean, covariance, rule="published")
    p = solve_dual(returns, 0.5).weights
    for t in range(5):
        k = sum(p[i] * offsets[i, t] for i in range(12))
        sigma = sum(p[i] * np.outer(offsets[i, t] - k, offsets[i, t] - k) for i in range(12))
        np.testing.assert_allclose(update.mean[t], k)
        np.testing.assert_allclose(update.covariance[t], sigma)


def test_damped_fit_keeps_its_share_of_the_old_covariance_and_measures_about_the_old_mean():
    rng, mean, covariance, offsets = problem()
    returns = rng.normal(size=12)
    update = updated(EpisodeBased, offsets, Scores(returns), mean, covariance, kept=0.3)
    p = solve_dual(returns, 0.5).weights
    for t in range(5):
        variance = sum(p[i] * (offsets[i, t] - mean[t]) ** 2 for i in range(12))
        np.testing.assert_allclose(update.covariance[t], 0.3 * covariance[t] + 0.7 * np.diag(variance))


def test_damped_fit_keeps_the_covariance_on_average_when_returns_carry_no_signal():
    rng, mean, covariance, _ = problem()
    policy = Policy(np.zeros((3, 1)), mean, covariance)
    fits = [
        fit(policy.sample(20, rng), np.tile(solve_dual(rng.normal(size=20), 1.0).weights, (5, 1)), mean, covariance,
            "damped", 0.0)[1]
        for _ in range(3000)
    ]  # fmt: skip
    np.testing.assert_allclose(np.mean(fits, axis=0), covariance, atol=0.05)


def test_reward_to_go_sums_from_each_step_on():
    rewards = np.random.default_rng(0).normal(size=(4, 6))
    for t in range(6):
        np.testing.assert_allclose(reward_to_go(rewards)[:, t], rewards[:, t:].sum(axis=1))


@pytest.mark.parametrize("rule", ["damped", "published"])
def test_step_based_with_rewards_only_at_the_last_step_is_episode_based(rule):
    rng, mean, covariance, offsets = problem()
    returns = rng.normal(size=12)
    rewards = np.zeros((12, 5))
    rewards[:, -1] = returns
    scores = Scores(returns, rewards)
    by_step = updated(StepBased, offsets, scores, mean, covariance, rule=rule)
    by_episode = updated(EpisodeBased, offsets, scores, mean, covariance, rule=rule)
    np.testing.assert_allclose(by_step.mean, by_episode.mean, atol=1e-9)
    np.testing.assert_allclose(by_step.covariance, by_episode.covariance, atol=1e-9)


def test_step_based_guards_a_vanishing_spread_near_the_end():
    _, mean, covariance, offsets = problem()
    rewards = np.random.default_rng(1).normal(size=(12, 5))
    rewards[:, 3:] = 0.25  # all reward-to-go equal from here on
    worth = StepBased(RepsSettings(epsilon=0.5), 12).worth(Scores(rewards.sum(axis=1), rewards))
    weights = solve_dual(worth.T, 0.5).weights
    np.testing.assert_allclose(weights[3:], 1 / 12)
    update = updated(StepBased, offsets, Scores(rewards.sum(axis=1), rewards), mean, covariance)
    assert np.isfinite(update.covariance).all()


@pytest.mark.parametrize("seed", range(10))
def test_the_default_update_finds_the_optimum_of_the_60_dimensional_quadratic(seed):
    """30 samples, 200 iterations: within 1e-4 of the optimum, on every seed.

    With independent noise: the optimum is independent from step to step, which noise correlated over time, the default
    of the tasks, does not explore.
    """
    learner = EpisodeBased(RepsSettings(), 30)
    rng = np.random.default_rng(seed)
    optimum = rng.standard_normal((20, 3))
    state = learner.start(Policy(np.zeros((3, 1)), np.zeros((20, 3)), np.tile(np.eye(3), (20, 1, 1))))
    for _ in range(200):
        offsets = learner.ask(state, 30, rng)
        state, _ = learner.tell(state, offsets, Scores(-np.sum((offsets - optimum) ** 2, axis=(1, 2))))
    assert -1e-4 < -np.sum((state.mean - optimum) ** 2) <= 0


@pytest.mark.parametrize("kind", [EpisodeBased, StepBased])
def test_an_update_learns_from_the_last_batches_together(kind):
    """Three batches told one after the other, each update against the same of the last two told at once."""
    rng, mean, covariance, _ = problem()
    policy = Policy(np.zeros((3, 1)), mean, covariance)
    learner, alone = (kind(RepsSettings(0.5, batches=batches), 12) for batches in (2, 1))
    state, before = learner.start(policy), None
    for _ in range(3):
        offsets = learner.ask(state, 12, rng)
        rewards = rng.normal(size=(12, 5))
        both = offsets, rewards
        if before is not None:
            both = tuple(map(np.concatenate, zip(before, both, strict=True)))
        expected, _ = alone.tell(alone.start(learner.policy(state)), both[0], Scores(both[1].sum(axis=1), both[1]))
        state, _ = learner.tell(state, offsets, Scores(rewards.sum(axis=1), rewards))
        np.testing.assert_allclose(state.mean, expected.mean, rtol=1e-12)
        np.testing.assert_allclose(state.covariance, expected.covariance, rtol=1e-12)
        before = offsets, rewards
    assert state.offsets.shape == (12, 5, 3)
