"""What every task keeps, with every spec that speaks of its signals and every reward that it has."""

import dataclasses
import itertools
import unittest

import numpy as np
import pytest
import yaml
from absl.testing import absltest
from dm_env import test_utils
from hypothesis import given, settings
from hypothesis import strategies as st

import tltlrl
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.learning.policy import Policy
from tltlrl.logic import load_spec
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.resources import CONFIGS, SPECS, spec_path
from tltlrl.simulation.rollout import Simulator
from tltlrl.store.run import read_results
from tltlrl.tasks.environment import environment
from tltlrl.training import build, start
from tltlrl.training.loop import iterate
from tltlrl.training.session import train

SPEC_NAMES = sorted(path.stem for path in SPECS.glob("*.tltl"))

BEST = ["reach_avoid_best", "visit_in_order_best", "toast_best", "toast_line", "toast_rest"]  # no published figure


def make(name):
    entry = TASKS.get(name)
    return entry.make(entry.config())


def rewards_of(name):
    entry = TASKS.get(name)
    return entry.rewards(entry.reward(), load_spec(spec_path(entry.spec)).constants)


def first_policy(task):
    return start.first_policy(task, read(compose([f"experiment={task.name}"]))[0].algorithm)


@pytest.fixture(scope="module", params=sorted(TASKS.built_in))
def task(request):
    return make(request.param)


@pytest.fixture(scope="module")
def batch(task):
    """Six trajectories of the first policy: (features, commands)."""
    policy = first_policy(task)
    simulator, rng = Simulator(task), np.random.default_rng(0)
    trajectories = simulator.rollout(policy.gain, policy.sample(6, rng), simulator.draw_command_noise(6, rng))
    return trajectories.features, trajectories.commands


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
    for name, reward in rewards_of(task.name).items():
        values, _ = reward(signals)
        assert values.shape == (6, task.steps), name
        assert np.isfinite(values).all(), name
        half = task.steps // 2
        first, memory = reward({k: v[:, :half] for k, v in signals.items()})
        np.testing.assert_array_equal(first, values[:, :half])
        np.testing.assert_array_equal(reward({k: v[:, half:] for k, v in signals.items()}, memory)[0], values[:, half:])
        np.testing.assert_array_equal(reward({k: v[2:3] for k, v in signals.items()})[0][0], values[2])


@given(cuts=st.sets(st.integers(1, 59)), seed=st.integers(0, 99))
@settings(max_examples=25, deadline=None)
@pytest.mark.parametrize("name", sorted(TASKS.built_in))
def test_a_reward_is_the_same_on_any_stretches_of_an_episode(name, cuts, seed):
    rng = np.random.default_rng(seed)
    d = 3 if name == "toast" else 2
    centre = {"toast": (0.7, -0.35, 0.05)}.get(name, (0.0, 1.2))
    walk = centre + 0.1 * d * rng.standard_normal((3, 60, d)).cumsum(axis=1)
    signals = {"ee": walk, "gripper": rng.uniform(0, 100, (3, 60))}
    for reward in rewards_of(name).values():
        whole, _ = reward(signals)
        parts, memory = [], None
        for a, b in itertools.pairwise([0, *sorted(cuts), 60]):
            part, memory = reward({key: values[:, a:b] for key, values in signals.items()}, memory)
            parts.append(part)
        np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole)


def test_every_case_takes_an_iteration(task):
    own = [f"{reward}_{name}" for reward in TASKS.get(task.name).hand_made for name in LEARNERS.built_in]
    full = ["tltl_episodic", *(case for case in own if not case.endswith("_cma"))]
    few = ["tltl_episodic", "tltl_cma", *(case for case in own if not case.endswith("_step"))]
    settings = [f"experiment={task.name}", "seeds=1"]
    studies = [
        read(compose([*settings, f"cases=[{','.join(full)}]"]))[0],
        read(compose([*settings, f"cases=[{','.join(few)}]", "algorithm.basis=4"]))[0],
    ]
    for run in itertools.chain(*(study.runs() for study in studies)):
        setup = build.set_up(run)
        policy = start.first_policy(setup.task, run.algorithm)
        result = iterate(run, setup, setup.learner.start(policy), 0)
        assert np.isfinite(list(result.record.values())).all(), run.case
        assert not np.array_equal(setup.learner.policy(result.state).mean, policy.mean), run.case


@pytest.mark.parametrize("name", BEST)
def test_what_is_best_trains(name, tmp_path):
    """Its second stage included."""
    study, _ = read(compose([f"experiment={name}", "algorithm.iterations=2", "seeds=1", "trials=1"]))
    for run in study.runs():
        if run.refine is not None:
            run = dataclasses.replace(run, refine=dataclasses.replace(run.refine, first=1))
        train(run, tmp_path / run.case.name, lambda _: None)
        assert read_results(tmp_path / run.case.name, run.identity())["iterations"] == 2


@pytest.mark.parametrize("name", BEST)
def test_what_is_best_is_one_case(name):
    study, _ = read(compose([f"experiment={name}"]))
    assert study.name == name
    assert len(study.cases) == 1


def test_the_first_policy_commands_the_reference_along_the_reference(task):
    features, commands = task.reference()
    assert features.shape == (task.steps, task.width)
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
    study, _ = read(compose([f"experiment={task.name}"]))
    assert build.make_task(study.task).steps == task.steps == {"toast": 100, "reach_avoid": 200}.get(task.name, 500)
    assert tltlrl.load_task(task.name)._step_limit == pytest.approx(task.steps - 1.5)


def test_environment_with_the_same_seed_is_the_same():
    for name in TASKS.built_in:
        steps = []
        for _ in range(2):
            env = tltlrl.load_task(name, seed=3)
            env.reset()
            timestep = [env.step(np.full(env.action_spec().shape, 0.3)) for _ in range(5)][-1]
            steps.append(np.concatenate([np.ravel(v) for v in timestep.observation.values()]))
        np.testing.assert_array_equal(*steps)


def test_policy_survives_a_covariance_of_zero(task):
    policy = Policy(np.zeros_like(task.feedback), np.zeros((task.steps, len(task.command_scale))),
                    np.zeros((task.steps, len(task.command_scale), len(task.command_scale))))  # fmt: skip
    np.testing.assert_array_equal(policy.sample(2, np.random.default_rng(0)), 0.0)


@pytest.mark.parametrize("name", sorted(TASKS.built_in))
@pytest.mark.parametrize("kind", ["hand-made", "spec", "none"])
def test_dm_envs_own_conformance_tests(name, kind):
    spec = load_spec(spec_path(TASKS.get(name).spec))
    reward = {"hand-made": next(iter(rewards_of(name).values())), "spec": spec, "none": None}[kind]

    class Conformance(test_utils.EnvironmentTestMixin, absltest.TestCase):
        def make_object_under_test(self):
            return environment(make(name), reward, random=0)

        def make_action_sequence(self):
            yield from (self.make_action() for _ in range(250))

    result = unittest.TestResult()
    unittest.defaultTestLoader.loadTestsFromTestCase(Conformance).run(result)
    assert result.testsRun > 3
    assert result.wasSuccessful(), [*result.errors, *result.failures]


def test_the_environment_of_a_spec_pays_its_robustness_at_the_end():
    task = make("reach_avoid")
    spec = load_spec(spec_path("reach_avoid"))
    env = environment(task, spec, noise=False)
    timestep, rng = env.reset(), np.random.default_rng(0)
    features, commands, rewards = [np.concatenate(list(timestep.observation.values()))], [], []
    while not timestep.last():
        commands.append(rng.uniform(-1, 1, 3))
        timestep = env.step(commands[-1])
        features.append(np.concatenate(list(timestep.observation.values())))
        rewards.append(timestep.reward)
    signals = task.signals(np.array(features)[None], np.array([*commands, commands[-1]])[None])
    assert rewards[:-1] == [0.0] * (task.steps - 2)
    assert rewards[-1] == spec.robustness(signals)[0]


def test_settings_of_every_task_have_defaults_that_the_configs_share(task):
    """One value in two places: the YAML file of a group is the dataclass's defaults."""
    entry = TASKS.get(task.name)
    for group, kind in (("task", entry.config), ("reward", entry.reward)):
        written = yaml.safe_load((CONFIGS / group / f"{task.name}.yaml").read_text())
        assert written == dataclasses.asdict(kind())
        assert all("setting" in field.metadata for field in dataclasses.fields(kind))
