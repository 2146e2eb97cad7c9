"""The dm_env view: what it adds to a task, and nothing else."""

import re

import numpy as np
import pytest

import tltlrl
from tltlrl.errors import UserError
from tltlrl.logic import SpecError, load_spec, parse_spec
from tltlrl.registry import TASKS
from tltlrl.resources import spec_path
from tltlrl.tasks.environment import environment
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig
from tltlrl.tasks.toast.scene import Toast, ToastConfig

STEPS = 12
SLIDER = """\
<mujoco>
  <option timestep="0.02" gravity="0 0 0"/>
  <worldbody><body><joint name="slide" type="slide"/><geom size="0.1"/></body></worldbody>
  <actuator><motor name="push" joint="slide" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


@pytest.fixture
def task():
    return PlanarArm(PlanarArmConfig(steps=STEPS, command_noise=0.1))


def observed(timestep):
    return np.concatenate(list(timestep.observation.values()))


def stepped(env, commands):
    return [env.reset(), *(env.step(command) for command in commands)]


def test_observations_are_the_features_by_group(task):
    timestep = environment(task).reset()
    features = task.features(*(state[None] for state in task.initial_state()))[0]
    assert list(timestep.observation) == ["angles", "velocities", "end_effector"]
    for name, values in timestep.observation.items():
        np.testing.assert_array_equal(values, features[task.slices[name]])


def test_the_noise_is_that_of_the_seeds_stream(task):
    """Commands without noise, but with the stream's numbers added, give the same motion."""
    commands = np.random.default_rng(0).normal(size=(STEPS - 1, 3))
    stream = np.random.RandomState(7)
    disturbed = [command + 0.1 * stream.standard_normal(3) for command in commands]
    noisy = stepped(environment(task, random=7), commands)
    quiet = stepped(environment(task, noise=False), disturbed)
    for a, b in zip(noisy, quiet, strict=True):
        np.testing.assert_array_equal(observed(a), observed(b))


def test_a_reward_sees_the_command_that_led_to_a_sample(task):
    def effort(signals, memory=None):
        return -np.sum(signals["command"] ** 2, axis=-1), memory

    commands = np.random.default_rng(0).normal(size=(STEPS - 1, 3))
    rewards = [step.reward for step in stepped(environment(task, effort), commands)[1:]]
    np.testing.assert_allclose(rewards, -np.sum(commands**2, axis=1))


def test_a_spec_of_commands_sees_every_one_that_was_sent(task):
    spec = parse_spec("signal command[3]\nspec: G command[0] < 1")
    for slow in range(STEPS - 1):
        commands = np.full((STEPS - 1, 3), 0.75)
        commands[slow] = 0.875
        rewards = [step.reward for step in stepped(environment(task, spec), commands)[1:]]
        assert rewards == [0.0] * (STEPS - 2) + [0.125]


def test_every_sample_is_looked_at_once(task):
    """The work per step does not grow with the episode."""
    lengths = []

    def reward(signals, memory=None):
        lengths.append(signals["ee"].shape[1])
        return np.zeros(signals["ee"].shape[:2]), memory

    stepped(environment(task, reward), np.zeros((STEPS - 1, 3)))
    assert lengths == [1] * STEPS


def test_a_spec_in_seconds_goes_by_the_tasks_clock(task):
    commands = np.random.default_rng(0).normal(size=(STEPS - 1, 3))

    def last_reward(window):
        spec = parse_spec(f"signal ee[2]\nspec: G{window} ee.x > 0")
        return stepped(environment(task, spec, noise=False), commands)[-1].reward

    assert last_reward("[0.1 s, 0.1 s]") == last_reward("[2, 2]") != last_reward("[3, 3]")


def test_the_spec_of_an_episode_that_ends_early_is_paid_when_it_ends():
    task = Toast(ToastConfig(command_noise=0.0))
    env = environment(task, parse_spec("signal ee[3]\nspec: F ee[2] < -0.2"))
    lean = np.zeros(8)
    lean[1] = 1.0  # down to the table
    timestep, rewards = env.reset(), []
    while not timestep.last():
        timestep = env.step(lean)
        rewards.append(timestep.reward)
    assert len(rewards) < task.steps - 1
    assert timestep.discount == 0.0
    assert rewards[:-1] == [0.0] * (len(rewards) - 1)
    assert rewards[-1] == -0.2 - timestep.observation["end_effector"][2] > 0


def test_a_second_episode_knows_nothing_of_the_first(task):
    def count(signals, memory=0):
        return np.full(signals["ee"].shape[:2], (memory or 0) + 1.0), (memory or 0) + 1

    env = environment(task, count)
    for _ in range(2):
        rewards = [step.reward for step in stepped(env, np.zeros((STEPS - 1, 3)))[1:]]
        assert rewards == list(range(2, STEPS + 1))


@pytest.mark.parametrize("name", TASKS.built_in)
def test_load_task_has_the_first_hand_made_reward(name):
    entry = TASKS.get(name)
    rewards = entry.rewards(entry.reward(), load_spec(spec_path(entry.spec)).constants)
    expected = environment(entry.make(entry.config()), rewards[entry.hand_made[0]], random=3)
    loaded = tltlrl.load_task(name, seed=3)
    commands = np.random.default_rng(0).normal(size=(9, *loaded.action_spec().shape))
    assert [s.reward for s in stepped(loaded, commands)] == [s.reward for s in stepped(expected, commands)]


def test_a_spec_of_other_signals_is_told():
    task = TASKS.get("reach_avoid").make(TASKS.get("reach_avoid").config())
    with pytest.raises(UserError, match=r"^spec: it needs a signal foo, which reach_avoid has not"):
        environment(task, parse_spec("F foo > 0"))
    with pytest.raises(SpecError, match="300"):
        environment(task, parse_spec("signal ee[2]\nspec: G[300,400] ee.x > 0"))


def test_an_unknown_task_is_told():
    with pytest.raises(UserError, match=r"^no task is named tost; did you mean toast\?$"):
        tltlrl.load_task("tost")


def test_load_task_takes_the_page_of_a_robot(tmp_path):
    """With the spec beside it as its reward, or none; a path or its text."""
    page = tmp_path / "arm.yaml"
    (tmp_path / "arm.xml").write_text(SLIDER)
    page.write_text("model: arm.xml\nduration: 0.1\ncontrol_timestep: 0.02\nsignals: {place: qpos.slide}\n")
    commands = np.ones((4, 1))
    assert [step.reward for step in stepped(tltlrl.load_task(page, seed=0), commands)[1:]] == [0.0] * 4
    (tmp_path / "arm.tltl").write_text("signal place\nspec: F[0.08 s, 0.08 s] place > 1\n")
    (*before, last) = stepped(tltlrl.load_task(str(page), seed=0), commands)[1:]
    assert [step.reward for step in before] == [0.0] * 3
    assert last.last()
    assert last.reward == last.observation["qpos"][0] - 1


@pytest.mark.parametrize(
    ("task", "beside", "message"),
    [
        ("arn.yaml", "", "task=arn.yaml: there is no such file; give the page of a robot"),
        ("arm.yaml", "signal top\nspec: F top > 1\n", "spec: it needs a signal top, which arm has not; there are: "),
        ("mjcf", "", "task: a robot is described by a page; give its file"),
        ("suite", "", "suite: its environments step by themselves; load one with dm_control.suite.load"),
    ],
)
def test_load_task_says_what_is_wrong(task, beside, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(SLIDER)
    (tmp_path / "arm.yaml").write_text("model: arm.xml\ncontrol_timestep: 0.02\nsignals: {place: qpos.slide}\n")
    if beside:
        (tmp_path / "arm.tltl").write_text(beside)
    with pytest.raises(UserError, match=re.escape(message)):
        tltlrl.load_task(task)
