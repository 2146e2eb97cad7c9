"""Gymnasium environments whose reward is a spec's robustness."""

import re
import textwrap
import warnings
from pathlib import Path

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

import tltlrl.gym  # noqa: E402
from tltlrl.errors import UserError  # noqa: E402
from tltlrl.logic import SpecError, parse_spec  # noqa: E402
from tltlrl.logic.online.potential import finite  # noqa: E402
from tltlrl.tasks.planar_arm.scene import PlanarArm  # noqa: E402

SHORT = "signal ee[2]\nspec: F[0,20] (ee.x > 0.5) & G (ee.y > -1)"


def episode(env, seed=3):
    env.action_space.seed(seed)
    observation, info = env.reset(seed=seed)
    rows, over = [(observation, 0.0, info)], False
    while not over:
        observation, reward, over, truncated, info = env.step(env.action_space.sample())
        assert not truncated
        rows.append((observation, reward, info))
    return rows


@pytest.mark.parametrize("name", ["ReachAvoid", "VisitInOrder", "Toast"])
def test_gymnasiums_own_check_has_nothing_to_say(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(f"tltlrl/{name}-v0")
        check_env(env.unwrapped, skip_render_check=True)


def test_nor_has_that_of_stable_baselines3():
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gymnasium.make("tltlrl/ReachAvoid-v0"))


def test_a_spec_for_a_pendulum_that_is_not_ours():
    spec = parse_spec("signal up\nsignal speed\nspec: F G (up > 0.9) & G (speed < 8.5)")
    places = {"up": "observation[0]", "speed": "observation[2]"}
    env = tltlrl.gym.wrap(gymnasium.make("Pendulum-v1"), spec, places)
    observation, info = env.reset(seed=0)
    env.action_space.seed(0)
    rewards, seen, over = [], [observation], False
    while not over:
        observation, reward, _, over, info = env.step(env.action_space.sample())
        rewards.append(reward)
        seen.append(observation)
    path = np.array(seen, dtype=float)[None]
    assert info["robustness"] == spec.robustness({"up": path[:, :, 0], "speed": path[:, :, 2]})[0]
    assert info["is_success"] == (info["robustness"] > 0)
    assert env.unwrapped.spec.id == "Pendulum-v1"


@pytest.mark.parametrize("reward", ["telescoped", "final"])
def test_the_rewards_of_an_episode_sum_to_its_robustness(reward):
    env = gymnasium.make("tltlrl/VisitInOrder-v0", reward=reward)
    rows = episode(env)
    total, info = sum(reward for _, reward, _ in rows), rows[-1][2]
    begin = 0.0 if reward == "final" else phi_at_start(env.unwrapped._robots)
    np.testing.assert_allclose(total, finite(np.array(info["robustness"])) - begin, rtol=0, atol=1e-12)
    assert info["is_success"] == (info["robustness"] > 0)
    assert info["decided_by"].startswith("at step ")
    assert all(row[2]["lower"] <= info["robustness"] <= row[2]["upper"] for row in rows)
    assert len(rows) == env.unwrapped._robots.task.steps
    if reward == "final":
        assert not any(reward for _, reward, _ in rows[:-1])


def phi_at_start(robots):
    robots.begin([np.random.default_rng(0)])
    (episodes,) = robots.judge._running
    return episodes.phi[0]


def test_a_spec_of_ones_own_with_constants(tmp_path):
    path = tmp_path / "task.tltl"
    path.write_text("signal ee[2]\nconst far = 0.5\nspec: F (ee.x > far)")
    env = gymnasium.make("tltlrl/ReachAvoid-v0", spec=str(path), constants={"far": -9})
    assert episode(env)[-1][2]["is_success"]
    with pytest.raises(UserError, match="reward: no such reward finale; did you mean final"):
        gymnasium.make("tltlrl/ReachAvoid-v0", reward="finale")
    with pytest.raises(UserError, match="needs the whole past, which no observation holds"):
        gymnasium.make(
            "tltlrl/ReachAvoid-v0", spec=parse_spec("signal ee[2]\nspec: G (ee.x > 0 => F[0,300] G ee.y > 0)")
        )
    with pytest.raises(UserError, match="spec: it needs a signal foo, which reach_avoid has not"):
        gymnasium.make("tltlrl/ReachAvoid-v0", spec=parse_spec("F foo > 0"))
    with pytest.raises(SpecError, match="300"):
        gymnasium.make("tltlrl/ReachAvoid-v0", spec=parse_spec("signal ee[2]\nspec: F ee.x > 0 & G[300,400] ee.x > 0"))


@pytest.mark.parametrize(
    ("name", "reward"), [("ReachAvoid", "telescoped"), ("VisitInOrder", "final"), ("Toast", "telescoped")]
)
def test_many_environments_are_as_each_alone(monkeypatch, name, reward):
    """Every byte, also where they end at different steps and begin anew."""
    monkeypatch.setattr(PlanarArm, "terminated", lambda _, features: features[:, 0] > 0.9)
    make = {"num_envs": 4, "reward": reward} | ({"spec": parse_spec(SHORT)} if name == "ReachAvoid" else {})
    many = gymnasium.make_vec(f"tltlrl/{name}-v0", vectorization_mode="vector_entry_point", **make)
    alone = gymnasium.make_vec(f"tltlrl/{name}-v0", vectorization_mode="sync", **make)
    assert (
        many.metadata["autoreset_mode"] == alone.metadata["autoreset_mode"] == gymnasium.vector.AutoresetMode.NEXT_STEP
    )
    assert many.observation_space == alone.observation_space
    assert many.action_space == alone.action_space
    same(many.reset(seed=7), alone.reset(seed=7))
    generator, ends = np.random.default_rng(0), []
    for step in range(103):
        actions = generator.uniform(-1, 1, many.action_space.shape).astype(np.float32)
        ours, theirs = many.step(actions), alone.step(actions)
        same(ours, theirs)
        ends += [step] * int(ours[2].sum())
    assert len(ends) >= 4
    assert name == "Toast" or len(set(ends)) > 2
    same(many.reset(), alone.reset())  # in the middle of some


def same(ours, theirs):
    """Whether two answers of vector environments are equal to the byte."""
    *arrays, infos = ours
    *others, known = theirs
    assert infos.keys() == known.keys()
    for one, other in zip([*arrays, *infos.values()], [*others, *(known[name] for name in infos)], strict=True):
        assert one.dtype == other.dtype
        assert one.tolist() == other.tolist() if one.dtype == object else one.tobytes() == other.tobytes()


class Walk(gymnasium.Env):
    """Somebody else's environment."""

    observation_space = gymnasium.spaces.Dict({"at": gymnasium.spaces.Box(-9, 9, (3,))})
    action_space = gymnasium.spaces.Box(-1, 1, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed, options=options)
        self.at = np.zeros(3)
        return {"at": self.at.copy()}, {"fuel": 5.0}

    def step(self, action):
        self.at[1] += action[0]
        return {"at": self.at.copy()}, -1.0, False, bool(self.at[1] > 2), {"fuel": 5.0 - self.at[1]}


def test_a_spec_around_another_environment():
    spec = parse_spec("signal p[2]\nsignal fuel\nsignal u\nspec: F (p.y > 1.5) & G (fuel > 1) & G (u < 2)")
    env = tltlrl.gym.wrap(Walk(), spec, {"p": "observation[at][0:2]", "fuel": "info[fuel]", "u": "action[0]"})
    env.reset()
    total, over = 0.0, False
    while not over:
        _, reward, _, over, info = env.step(np.array([1.0]))
        total += reward
    assert info["is_success"]
    assert info["robustness"] == 1.0
    assert info["decided_by"] == "at step 3 by fuel > 1, margin +1"


@pytest.mark.parametrize(
    ("signals", "problem"),
    [
        ({}, "signals: the spec needs x; expected its place"),
        ({"x": "__import__('os')"}, "signals: x is at '__import__\\('os'\\)'; expected observation, info or action"),
        ({"x": "observation[to]"}, "signals: x: there is no 'to' in dict"),
        ({"x": "observation[at]"}, r"signals: x has shape \(3,\) at its place; expected 1 numbers"),
    ],
)
def test_places_that_cannot_be_read(signals, problem):
    with pytest.raises(UserError, match=problem):
        tltlrl.gym.wrap(Walk(), parse_spec("F (x > 1)"), signals).reset()


def test_an_episode_starts_where_the_tasks_spread_puts_it(monkeypatch):
    monkeypatch.setattr(PlanarArm, "start_spread", np.full(3, 0.1))
    make = {"spec": parse_spec(SHORT)}
    alone = [tltlrl.gym.SpecEnv("reach_avoid", **make).reset(seed=seed)[0][:3] for seed in (5, 6, 5)]
    together, _ = tltlrl.gym.SpecVectorEnv("reach_avoid", 2, **make).reset(seed=5)
    still, _ = tltlrl.gym.SpecEnv("reach_avoid", noise=False, **make).reset(seed=5)
    np.testing.assert_array_equal(alone[0], alone[2])
    np.testing.assert_array_equal(together[:, :3], alone[:2])
    assert 0 < np.abs(alone[0] - still[:3]).max() < 0.5
    assert np.abs(alone[0] - alone[1]).max() > 0


@pytest.mark.parametrize(
    ("action", "error", "message"),
    [
        (np.nan, ValueError, "the action for environment 1 is NaN; look for what made it so in the policy"),
        (
            1.0,
            FloatingPointError,
            "the simulation of reach_avoid diverged: environment 1, [0-9.]+ s; a smaller timestep of the model, more "
            "damping or armature in its joints, or smaller actions usually help",
        ),
    ],
)
def test_what_goes_wrong_is_told_and_no_robot_starts_again_by_itself(monkeypatch, action, error, message):
    """MuJoCo would leave out a command that is NaN, and reset a robot that diverged."""
    compiled = PlanarArm.make_physics

    def pushed_the_harder_the_faster(task):
        physics = compiled(task)
        physics.model.dof_damping[:] = -1e6
        return physics

    if error is FloatingPointError:
        monkeypatch.setattr(PlanarArm, "make_physics", pushed_the_harder_the_faster)
    envs = gymnasium.make_vec("tltlrl/ReachAvoid-v0", num_envs=2, noise=False)
    envs.reset(seed=0)
    actions = np.zeros((2, 3))
    actions[1] = action
    with pytest.raises(error, match=message):
        [envs.step(actions) for _ in range(100)]


def test_the_pages_environments(tmp_path, monkeypatch):
    """The code of docs/online.md as written, on a spec and an environment of the kind that it speaks of."""
    page = (Path(__file__).parents[1] / "docs/online.md").read_text(encoding="utf-8").split("## Gymnasium")[1]
    made, wrapped, pendulum = re.findall(r"(?<=\n\n)((?: {4}.*\n)+)", page)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_task.tltl").write_text(f"const goal_radius = 0.2\n{SHORT.replace('0.5', 'goal_radius')}")
    (tmp_path / "task.tltl").write_text("signal ee[2]\nsignal fuel\nspec: F (ee.x > 0.5) & G (fuel > 0)")
    names = {"tltlrl": tltlrl}
    exec(textwrap.dedent(made), names)
    names["env"].reset(seed=0)
    names["envs"].reset(seed=0)
    assert names["envs"].num_envs == 20
    names["env"] = Fuelled(gymnasium.make("Pendulum-v1"))
    exec(textwrap.dedent(wrapped), names)
    assert "robustness" in names["env"].reset(seed=0)[1]
    exec(textwrap.dedent(pendulum), names)
    names["env"].reset(seed=0)
    assert "robustness" in names["env"].step(names["env"].action_space.sample())[-1]


class Fuelled(gymnasium.Wrapper):
    """An environment that tells its fuel."""

    def reset(self, **options):
        observation, info = super().reset(**options)
        return observation, info | {"fuel": 1.0}
