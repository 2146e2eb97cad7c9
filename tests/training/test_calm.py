"""How much of the learned robustness a calm motion may spend, and that what would spend more is refused."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.logic import parse_spec
from tltlrl.simulation.trials import mean_motion
from tltlrl.training.build import set_up
from tltlrl.training.calm import NOISY, begin, calm_policy, calmer, events, floor, straightness
from tltlrl.training.start import first_policy


def test_the_floor_sinks_to_the_share_and_stays_there():
    floors = [floor(0.5, 0.7, batch, 10) for batch in range(10)]
    assert np.all(np.diff(floors[:7]) < 0)
    assert floors[6:] == pytest.approx([0.35] * 4)
    assert floors[0] < 0.5


def test_the_path_is_made_short_before_it_is_made_even():
    weights = [straightness(batch, 10) for batch in range(10)]
    assert np.all(np.diff(weights[:8]) < 0)
    np.testing.assert_allclose(np.diff(np.log(weights[:7])), np.log(weights[1] / weights[0]))
    assert weights[0] == 1
    assert weights[7:] == pytest.approx([0.06] * 3)


def test_events_are_where_a_predicate_becomes_true_or_false():
    spec = parse_spec("signal x\nspec: F x > 1 & G x > -9 & F x < 0")
    task = SimpleNamespace(signals=lambda features, _: {"x": features[..., 0]})
    x = np.array([0.5, 2, 2, 0.5, 0.5, -1, 5, 5])
    motion = SimpleNamespace(
        features=x[None, :, None], commands=None, lengths=np.array([6])
    )  # the rest is after its end
    assert events(spec, task, motion).tolist() == [1, 3, 5]


EASY = {"reach_avoid": "signal ee[2]\nspec: G ee.x > -10", "toast": "signal ee[3]\nspec: G ee.z > -10"}


@pytest.fixture(scope="module")
def jerky():
    """Makes run, setup and an abrupt policy of a task, with a spec that nothing violates."""

    def make(task, *overrides):
        small = ("cases=[tltl_episodic]", "seeds=[1]", "task.steps=30")
        study, _ = read(compose([f"experiment={task}", *small, *overrides]))
        run = replace(study.runs()[0], spec=parse_spec(EASY[task]))
        setup = set_up(run)
        policy = first_policy(setup.task, run.algorithm)
        noise = np.random.default_rng(1).normal(size=policy.mean.shape)
        return run, setup, replace(policy, mean=policy.mean + 0.3 * noise * setup.task.command_scale)

    return make


def batches(run, setup, policy, count, least=0.0):
    calm = begin(run, setup, policy)
    for _ in range(count):
        calm = calmer(run, setup, policy, calm, least, 1.0)
    return calm


class Strict:
    """A spec that says of one motion with noise that it fails."""

    def __init__(self, spec):
        self.predicates_over_time, self._robustness = spec.predicates_over_time, spec.robustness

    def robustness(self, signals, lengths):
        values = self._robustness(signals, lengths)
        values[-1] = -1.0 if len(values) == 1 + NOISY else values[-1]
        return values


def test_what_would_spend_too_much_or_fails_with_noise_is_refused(jerky):
    run, setup, policy = jerky("reach_avoid")
    start = begin(run, setup, policy).commands
    assert not np.array_equal(batches(run, setup, policy, 1).commands, start)
    for refused in (
        batches(run, setup, policy, 1, least=np.inf),
        batches(replace(run, spec=Strict(run.spec)), setup, policy, 1),
    ):
        np.testing.assert_array_equal(refused.commands, start)
        assert refused.batches == 1
        assert refused.episodes >= 20


def test_trials_begin_where_those_of_the_evaluation_may(jerky):
    run, setup, policy = jerky("reach_avoid")
    seen = []

    class Spread:
        command_range, draw_command_noise = setup.simulator.command_range, setup.simulator.draw_command_noise

        def draw_starts(self, count, rng):
            return rng.normal(size=(count, 3))

        def rollout(self, gain, offsets, noise, starts=None):
            seen.append(starts)
            return setup.simulator.rollout(gain, offsets, noise, starts)

    batches(run, replace(setup, simulator=Spread()), policy, 1)
    tried = [starts for starts in seen if starts is not None]
    assert tried
    for starts in tried:
        assert starts.shape == (1 + NOISY, 3)
        assert np.array_equal(starts.any(axis=1), np.arange(1 + NOISY) > 0)  # the first is judged from the task's own


def test_the_gripper_does_as_it_did(jerky):
    run, setup, policy = jerky("toast")
    before, after = begin(run, setup, policy).commands, batches(run, setup, policy, 2).commands
    moved = np.flatnonzero(np.any(before != after, axis=0))
    assert moved.tolist() == list(range(8))[setup.task.joint_commands] == [0, 1, 2, 3, 4, 5, 6]


@pytest.mark.parametrize("feedback", [-1, -20])
def test_the_policy_makes_the_motion_of_the_commands_alone_whatever_its_feedback(jerky, feedback):
    run, setup, policy = jerky("reach_avoid", f"algorithm.feedback={feedback}")
    calm = batches(run, setup, policy, 2)
    by_policy = mean_motion(setup.simulator, calm_policy(policy, calm))
    alone = setup.simulator.rollout(0 * policy.gain, calm.commands[None], np.zeros((1, *calm.commands.shape)))
    np.testing.assert_allclose(by_policy.features, alone.features, atol=1e-9)
    np.testing.assert_allclose(by_policy.commands[0], calm.commands, atol=1e-9)
