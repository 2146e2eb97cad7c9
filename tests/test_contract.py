"""What every task keeps, with every spec that speaks of its signals and every reward that it has."""

import unittest

import numpy as np
import pytest
from absl.testing import absltest
from dm_env import test_utils

import tltlrl
from tltlrl.config.compose import compose
from tltlrl.config.read import experiment_from
from tltlrl.learning.policy import Policy
from tltlrl.logic import load_spec
from tltlrl.resources import SPECS
from tltlrl.simulation.rollout import Simulator
from tltlrl.tasks import TASKS, make_default
from tltlrl.tasks.task import environment
from tltlrl.training.loop import case_names, initial_policy, iterate

SPEC_NAMES = sorted(path.stem for path in SPECS.glob("*.tltl"))


def make(name):
    return make_default(name, random=0)


def first_policy(task):
    return initial_policy(task, experiment_from(compose([f"experiment={task.name}"])).algorithm)


@pytest.fixture(scope="module", params=sorted(TASKS))
def task(request):
    return make(request.param)


@pytest.fixture(scope="module")
def batch(task):
    """Six trajectories of the first policy: (features, commands)."""
    policy = first_policy(task)
    simulator, rng = Simulator(task), np.random.default_rng(0)
    trajectories = simulator.rollout(policy.gain, policy.sample(6, rng), simulator.draw_command_noise(6, rng))
    return trajectories.features, trajectories.commands


def test_shapes_and_names(task, batch):
    features, commands = batch
    assert features.shape == (6, task.steps, len(task.observation))
    assert commands.shape == (6, task.steps, len(task.action))
    assert np.isfinite(features).all()
    assert task.command_noise.shape == task.command_scale.shape == (len(task.action),)
    assert (task.command_noise > 0).all()
    assert task.feedback.shape == (len(task.action), len(task.observation))
    assert len({q.name for q in task.observation}) == len(task.observation)


def test_signals_are_per_trajectory_and_step(task, batch):
    for name, values in task.signals(*batch).items():
        assert values.shape[:2] == (6, task.steps), name
        assert values.ndim in (2, 3), name


@pytest.mark.parametrize("name", SPEC_NAMES)
def test_every_spec_of_the_tasks_signals_gives_one_finite_robustness_per_trajectory(task, batch, name):
    spec = load_spec(SPECS / f"{name}.tltl")
    signals = task.signals(*batch)
    offered = {key: None if values.ndim == 2 else values.shape[2] for key, values in signals.items()}
    if any(offered.get(key, ()) != dimension for key, dimension in spec.signals.items()):
        assert name != task.name, "a task's own spec must speak of its signals"
        pytest.skip(f"{name} speaks of signals that {task.name} has not")
    robustness = spec.robustness(signals)
    assert robustness.shape == (6,)
    assert np.isfinite(robustness).all()
    assert len(spec.explain(signals)) == 6


def test_rewards_are_finite_and_each_value_depends_on_the_past_alone(task, batch):
    signals = task.signals(*batch)
    for name, reward in task.rewards.items():
        values = reward(signals)
        assert values.shape == (6, task.steps), name
        assert np.isfinite(values).all(), name
        half = task.steps // 2
        np.testing.assert_array_equal(reward({k: v[:, :half] for k, v in signals.items()}), values[:, :half])
        np.testing.assert_array_equal(reward({k: v[2:3] for k, v in signals.items()})[0], values[2])


def test_every_case_takes_an_iteration(task):
    cases = case_names(list(TASKS[task.name].hand_made))
    for run in experiment_from(compose([f"experiment={task.name}", f"cases=[{','.join(cases)}]", "seeds=1"])).runs():
        made = run.make_task()
        policy = initial_policy(made, run.algorithm)
        result = iterate(run, made, Simulator(made), policy, 0)
        assert np.isfinite(list(result.record.values())).all(), run.case
        assert not np.array_equal(result.policy.mean, policy.mean), run.case


def test_the_first_policy_commands_the_reference_along_the_reference(task):
    features, commands = task.reference()
    assert features.shape == (task.steps, len(task.observation))
    policy = first_policy(task)
    np.testing.assert_allclose(features @ policy.gain.T + policy.mean, commands, atol=1e-9)


def test_same_noise_same_trajectories(task):
    policy = first_policy(task)
    first, second = (
        Simulator(task).rollout(policy.gain, policy.sample(3, rng), Simulator(task).draw_command_noise(3, rng))
        for rng in (np.random.default_rng(1), np.random.default_rng(1))
    )
    np.testing.assert_array_equal(first.features, second.features)


def test_load_task_is_the_task_of_its_experiment(task):
    config = experiment_from(compose([f"experiment={task.name}"]))
    assert config.runs()[-1].make_task().steps == task.steps == {"toast": 100, "reach_avoid": 200}.get(task.name, 500)
    assert tltlrl.load_task(task.name)._step_limit == pytest.approx(task.steps - 1.5)


def test_environment_with_the_same_seed_is_the_same():
    for name in TASKS:
        steps = []
        for _ in range(2):
            env = tltlrl.load_task(name, seed=3)
            env.reset()
            timestep = [env.step(np.full(env.action_spec().shape, 0.3)) for _ in range(5)][-1]
            steps.append(np.concatenate([np.ravel(v) for v in timestep.observation.values()]))
        np.testing.assert_array_equal(*steps)


def test_policy_survives_a_covariance_of_zero(task):
    policy = Policy(np.zeros_like(task.feedback), np.zeros((task.steps, len(task.action))),
                    np.zeros((task.steps, len(task.action), len(task.action))))  # fmt: skip
    np.testing.assert_array_equal(policy.sample(2, np.random.default_rng(0)), 0.0)


@pytest.mark.parametrize("name", sorted(TASKS))
def test_dm_envs_own_conformance_tests(name):
    class Conformance(test_utils.EnvironmentTestMixin, absltest.TestCase):
        def make_object_under_test(self):
            return environment(make(name))

        def make_action_sequence(self):
            yield from (self.make_action() for _ in range(250))

    result = unittest.TestResult()
    unittest.defaultTestLoader.loadTestsFromTestCase(Conformance).run(result)
    assert result.testsRun > 3
    assert result.wasSuccessful(), [*result.errors, *result.failures]
