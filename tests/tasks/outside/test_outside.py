"""Environments of others as tasks: what they observe, their trajectories, their runs, and mistakes about them."""

import dataclasses

import numpy as np
import pytest
from dm_control import suite

from tltlrl.cli import main as cli
from tltlrl.config.compose import as_meant, compose
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.experiments.processes import run_in_processes
from tltlrl.registry import TASKS
from tltlrl.simulation.check_task import check_task
from tltlrl.simulation.outside import unlike
from tltlrl.simulation.simulator import simulator_of
from tltlrl.tasks.outside.environment import Described
from tltlrl.training.check import unlike_resets
from tltlrl.training.session import train

SPEC = "signal position[4]\nconst high = 0.3\nspec: F position[3] > high\n"
SMALL = (
    "task=suite", "task.id=ball_in_cup-catch", "spec=cup.tltl", "task.steps=6", "task.start=null", "trials=2",
    "algorithm.iterations=3", "algorithm.samples=3", "cases=tltl_episodic,environment_step",
)  # fmt: skip


def task_of(name, identity, **settings):
    entry = TASKS.get(name)
    return entry.make(dataclasses.replace(entry.config(), id=identity, **settings))


class Moody:
    """An environment whose resets are not what they were; it ends at its third step, and diverges on a full command."""

    resets = 0

    def reset(self, seed):
        Moody.resets += 1
        self._step = 0
        return np.array([0.0, Moody.resets * (seed == 1)])

    def step(self, command):
        self._step += 1
        return np.array([self._step, np.nan if abs(command[0]) >= 1 else 0.0]), 0.5, self._step == 3

    def picture(self, height, width):
        return np.zeros((height, width, 3), np.uint8)


@pytest.fixture
def moody(monkeypatch):
    said = Described(lambda _: Moody(), {"place": 2}, np.array([-1.0]), np.array([1.0]), 8, 0.1)
    monkeypatch.setattr("tltlrl.tasks.outside.of_suite.described", lambda _: said)
    return lambda **settings: task_of("suite", "moody", **settings)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cup.tltl").write_text(SPEC)
    return tmp_path


def test_its_trajectories_are_those_of_the_environment_itself():
    """Beside dm_control's own loop, noise and cut commands included."""
    task = task_of("suite", "ball_in_cup-catch", steps=9, start=3, feedback={"command_0": {"velocity_0": 0.5}})
    check_task(task)
    simulator, rng = simulator_of(task), np.random.default_rng(0)
    offsets, noise = rng.normal(0, 1.5, (2, 9, 2)), simulator.draw_command_noise(2, rng)
    motion = simulator.rollout(-task.feedback, offsets, noise, simulator.draw_starts(2, rng))
    signals = task.signals(motion.features, motion.commands)
    for i in range(2):
        env = suite.load("ball_in_cup", "catch", {"random": 3})
        step = env.reset()
        for t in range(9):
            expected = np.concatenate([step.observation["position"], step.observation["velocity"]])
            np.testing.assert_array_equal(motion.features[i, t, :-1], expected)
            assert signals["reward"][i, t] == (step.reward or 0.0)
            np.testing.assert_array_equal(signals["position"][i, t], step.observation["position"])
            command = offsets[i, t] + [0.5 * step.observation["velocity"][0], 0]
            np.testing.assert_allclose(signals["command"][i, t], command, rtol=0, atol=1e-12)
            step = env.step(np.clip(motion.commands[i, t] + noise[i, t], -1, 1))


def test_an_environment_of_gymnasium_has_its_slices_as_signals():
    gymnasium = pytest.importorskip("gymnasium")
    task = task_of(
        "gymnasium", "Pendulum-v1", signals={"tip": "observation[0:2]", "both": ["reward", "observation[-1]"]}
    )
    check_task(task)
    assert (task.name, task.steps, task.control_timestep) == ("Pendulum_v1", 201, 0.05)
    zeros = np.zeros((1, 201, 1))
    signals = task.signals(
        *[getattr(simulator_of(task).rollout(0 * task.feedback, zeros, zeros), of) for of in ("features", "commands")]
    )
    env = gymnasium.make("Pendulum-v1")
    first, _ = env.reset(seed=0)
    second, paid, *_ = env.step(np.zeros(1))
    np.testing.assert_array_equal(signals["tip"][0, :2], np.array([first, second], float)[:, :2])
    np.testing.assert_array_equal(signals["both"][0, :2], [[0, first[2]], [paid, second[2]]])


def test_an_episode_ends_with_the_environment_and_nothing_is_paid_after(moody):
    task = moody()
    zeros = np.zeros((2, 8, 1))
    motion = simulator_of(task).rollout(task.feedback, zeros, zeros)
    assert motion.lengths.tolist() == [4, 4]
    np.testing.assert_array_equal(motion.features[0, :, 0], [0, 1, 2, 3, 3, 3, 3, 3])
    np.testing.assert_array_equal(motion.features[0, :, -1], [0, 0.5, 0.5, 0.5, 0, 0, 0, 0])
    reward = TASKS.get("suite").rewards(None, {})["environment"]
    np.testing.assert_array_equal(reward(task.signals(motion.features, motion.commands))[0].sum(axis=1), [1.5, 1.5])
    zeros[1, 2] = 1.0
    with pytest.raises(FloatingPointError, match=r"^moody diverged: trajectory 1, step 3, 0\.3 s; less exploration"):
        simulator_of(task).rollout(task.feedback, zeros, 0 * zeros)


def test_resets_that_differ_are_told_at_once(moody):
    assert unlike(moody(), moody().outside) is None
    task = moody(start=1)
    assert unlike(task, task.outside) == "place_1 at step 0"
    with pytest.raises(UserError, match="repeatable: two resets with one seed differ in place_1 at step 0"):
        check_task(task)


def test_starts_are_drawn_anew_where_no_seed_is_given():
    task = task_of("suite", "cartpole-swingup", steps=3, start=None)
    simulator = simulator_of(task)
    zeros = np.zeros((3, 3, 1))
    starts = simulator.draw_starts(2, np.random.default_rng(0))
    first = simulator.rollout(task.feedback, zeros, zeros, starts).features[:, 0]
    assert len({row.tobytes() for row in first}) == 3
    np.testing.assert_array_equal(first[2, :-1], task.reference()[0][0, :-1])  # the mean motion has the seed 0


def test_a_run_is_the_same_for_any_workers_and_after_a_stop(here):
    study, _ = read(compose([as_meant(each) for each in (*SMALL, "seeds=1", "constants.high=0.2")]))
    assert unlike_resets(study) is None
    runs, told = study.runs(), {}
    run_in_processes(train, [(run, here / run.case.name) for run in runs], 2, lambda *_: None, told.__setitem__)
    assert told == {0: None, 1: None}
    for run in runs:

        def stop(iteration):
            if iteration == 2:
                raise KeyboardInterrupt

        own = here / "own" / run.case.name
        with pytest.raises(KeyboardInterrupt):
            train(run, own, stop)
        train(run, own, lambda _: None)
        for name in ("progress.csv", "clauses.csv"):
            assert (own / name).read_bytes() == (here / run.case.name / name).read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["task=suite"], "task.id: there is no environment without a name; for instance task.id=ball_in_cup-catch"),
        (
            ["task=suite", "task.id=ball_in_cup-cath"],
            "task.id: there is no environment ball_in_cup-cath; did you mean ball_in_cup-catch?",
        ),
        (
            ["task=gymnasium", "task.id=Pendulum-v0"],
            "task.id: there is no environment Pendulum-v0; did you mean Pendulum-v1?",
        ),
        (
            ["task=gymnasium", "task.id=CartPole-v1"],
            "task.id: CartPole-v1 has commands of the kind Discrete; expected continuous ones (Box); take another "
            "environment",
        ),
        (
            ["task=gymnasium", "task.id=os:Pendulum-v1"],
            "task.id: os:Pendulum-v1 names code to import, which no config may; install a package that registers its "
            "environments with Gymnasium, and give the id alone",
        ),
        ([*SMALL[:2], "task.signals.tip=pos[0]"], "task.signals.tip: there is no observation pos"),
        (
            [*SMALL[:2], "task.signals.tip=position[7]"],
            "task.signals.tip: position[7] is empty: position has 4 numbers",
        ),
        ([*SMALL[:2], "task.signals.tip=position[0"], "task.signals.tip: position[0 is no slice of an observation"),
        ([*SMALL[:2], "task.signals.G=position"], "task.signals.G: it cannot be a name of a signal here"),
        ([*SMALL[:2], "task.feedback.command_9.x=1"], "task.feedback.command_9: there is no such command"),
        ([*SMALL[:2], "task.feedback.command_0.x=1"], "task.feedback.command_0.x: there is no such feature"),
        ([*SMALL[:2], "task.feedback.command_0=1"], "task.feedback.command_0: expected {FEATURE: gain}, not 1"),
        ([*SMALL[:2], "task.steps=1"], "task.steps: 1 is too small"),
        (
            [*SMALL[:2], "spec=far.tltl"],
            "spec: it needs a signal ee, which ball_in_cup_catch has not; there are: command, position, reward, "
            "velocity; name numbers of an observation by 'task.signals.ee=position[0:2]'",
        ),
        ([*SMALL[:2], "cases=discrete_step"], "cases: no case is named discrete_step"),
    ],
)
def test_mistakes_are_told_and_nothing_is_written(here, capsys, arguments, message):
    if "task=gymnasium" in arguments:
        pytest.importorskip("gymnasium")
    (here / "far.tltl").write_text("signal ee[2]\nspec: F ee.x > 1\n")
    assert cli.run(["spec=cup.tltl", *arguments]) == 2
    assert capsys.readouterr().err.startswith(f"tltl-run: {message}")
    assert not (here / "runs").exists()


def test_tltl_tasks_says_what_it_observes(capsys):
    with pytest.raises(SystemExit) as ended:
        cli.main(["tasks", "suite", "ball_in_cup-catch"])
    assert ended.value.code == 0
    first, commands, _, *signals = capsys.readouterr().out.splitlines()
    assert first == "ball_in_cup_catch: 1001 samples, one every 0.02 s, 20.02 s in all"
    assert commands == "commands: command_0, command_1"
    assert [line.split()[0] for line in signals] == ["position[4]", "velocity[4]", "reward", "command[2]"]
