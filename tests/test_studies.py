"""The studies in benchmarks/ train what the product trains, and their rules are what they say."""

import dataclasses

import numpy as np
import pytest

from benchmarks import covariance, grid_search
from benchmarks.lockstep import Kinematic, Learner, train
from tltlrl.cli import compose
from tltlrl.config import experiment_from
from tltlrl.reps import fit
from tltlrl.rollout import Simulator
from tltlrl.training import initial_policy, iterate


@pytest.mark.parametrize("case", ["tltl_episodic", "continuous_episodic", "continuous_step"])
def test_runs_in_lockstep_are_the_products_runs(case):
    settings = ["experiment=visit_in_order", f"cases=[{case}]", "seeds=[3, 8]", "algorithm.samples=5"]
    runs = experiment_from(compose(settings)).runs()
    a = runs[0].algorithm
    task = runs[0].make_task()
    reward = task.rewards.get(runs[0].case.reward)

    def rule(*arguments):
        return fit(*arguments, a.covariance, a.kept)

    learners = [Learner(run.seed, rule, a.epsilon, reward, run.case.algorithm == "step") for run in runs]
    curves = train(task, runs[0].spec, Simulator(task), initial_policy(task, a), learners, a.samples, 3)
    for j, run in enumerate(runs):
        policy = initial_policy(task, a)
        for i in range(3):
            result = iterate(run, task, Simulator(task), policy, i)
            policy = result.policy
            np.testing.assert_allclose(curves.samples[i, j], result.record["robustness_mean"], rtol=1e-9)
            np.testing.assert_allclose(curves.policy[i, j], result.record["robustness_policy"], rtol=1e-9)


def test_the_kinematic_model_stays_within_six_centimetres_of_the_simulation_under_full_exploration():
    run = experiment_from(compose(["experiment=visit_in_order"])).runs()[0]
    task, rng = run.make_task(), np.random.default_rng(0)
    policy = initial_policy(task, run.algorithm)
    offsets, noise = policy.sample(5, rng), np.zeros((5, task.steps, 3))
    ends = [kind(task).rollout(policy.gain, offsets, noise).features[..., 6:8] for kind in (Kinematic, Simulator)]
    assert np.linalg.norm(ends[0] - ends[1], axis=-1).max() < 0.06


def test_bounded_rule_reaches_its_bound_and_otherwise_is_the_diagonal_fit():
    rng = np.random.default_rng(0)
    mean, old = rng.normal(size=(4, 3)), np.tile(np.diag([1.0, 2.0, 0.5]), (4, 1, 1))
    offsets, weights = mean + rng.normal(size=(12, 4, 3)), np.full((4, 12), 1 / 12)
    weights[0, :6] *= np.linspace(0.5, 1.5, 6)
    new, s = covariance.bounded(0.05)(offsets, weights, mean, old)
    shift, precision = new - mean, np.linalg.inv(s)
    kl = 0.5 * (
        np.trace(precision @ old, axis1=1, axis2=2)
        + np.einsum("ti,tij,tj->t", shift, precision, shift)
        - 3
        + np.linalg.slogdet(s)[1]
        - np.linalg.slogdet(old)[1]
    )
    np.testing.assert_allclose(kl, 0.05, atol=1e-4)
    free_mean, free = covariance.bounded(1e9)(offsets, weights, mean, old)
    fitted_mean, fitted = covariance.published(offsets, weights, mean, old)
    np.testing.assert_allclose(free_mean, fitted_mean, atol=1e-4)
    np.testing.assert_allclose(free, fitted * np.eye(3), atol=1e-4)


def test_grid_search_gives_one_row_per_point_and_seed():
    results = grid_search.search("reach_avoid", "continuous_step", [{"c2": 0.0}, {"c2": 0.3}], [100, 101], True, 2)
    assert list(zip(results["c2"], results["seed"], strict=True)) == [(0.0, 100), (0.0, 101), (0.3, 100), (0.3, 101)]
    assert results["robustness_policy"].nunique() == 4


def test_every_rule_can_be_named_on_the_command_line():
    for text in ("published", "damped:0.3,epsilon=0.5", "damped_about_new:0.5", "bounded:0.1", "shared", "floored:0.1"):
        setting = covariance.parse_setting(text)
        assert callable(setting.fit())
    assert dataclasses.asdict(covariance.parse_setting("damped:0.3,epsilon=0.5"))["epsilon"] == 0.5
