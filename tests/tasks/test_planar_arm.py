"""The arm: its table, its kinematics, its servo, its rewards."""

import re
from dataclasses import replace
from importlib.resources import files

import mujoco
import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.simulation.rollout import Simulator
from tltlrl.tasks.environment import environment
from tltlrl.tasks.mjcf.file import config_of
from tltlrl.tasks.mjcf.robot import Robot
from tltlrl.tasks.planar_arm import scene
from tltlrl.tasks.planar_arm.rewards import (
    ReachAvoidReward,
    VisitInOrderReward,
    reach_avoid_rewards,
    visit_in_order_rewards,
)
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig, arm_model, forward_kinematics

ARM, REACH_AVOID, VISIT_IN_ORDER = PlanarArmConfig(), ReachAvoidReward(), VisitInOrderReward()
PAGE = """\
model: arm.xml
duration: 10
start: {joint_1: 0.5, joint_2: 0.5, joint_3: 0.5}
command_noise: 0.01
feedback: {speed_1: -1, speed_2: -1, speed_3: -1}
signals:
  ee: [site_xpos.end_effector.x, site_xpos.end_effector.y]
  angles: [qpos.joint_1, qpos.joint_2, qpos.joint_3]
  velocities: [qvel.joint_1, qvel.joint_2, qvel.joint_3]
"""
CONSTANTS = {
    "goal": (-1.2, 1.4),
    "goal_radius": 0.2,
    "obstacle": {"1": (0.3, 2.0), "2": (-0.6, 0.6)},
    "obstacle_radius": {"1": 0.5, "2": 0.4},
}


def test_observation_table_of_the_docstring_is_the_code():
    rows = re.findall(r"^\| (\d) \| (\w+) \| (\S+) \|$", scene.__doc__, flags=re.MULTILINE)
    assert [(int(i), name, unit) for i, name, unit in rows] == [
        (i, *part) for i, part in enumerate((n, group.unit) for group in PlanarArm.observation for n in group.parts)
    ]


def test_each_feature_is_the_quantity_that_the_table_says():
    task = PlanarArm(ARM)
    physics = task.make_physics()
    rng = np.random.default_rng(0)
    for _ in range(20):
        physics.data.qpos[:], physics.data.qvel[:] = rng.normal(size=3), rng.normal(size=3)
        physics.forward()
        features = task.features(np.array(physics.data.qpos)[None], np.array(physics.data.qvel)[None])[0]
        expected = {
            **{f"angle_{i}": physics.named.data.qpos[f"joint_{i}"][0] for i in (1, 2, 3)},
            **{f"velocity_{i}": physics.named.data.qvel[f"joint_{i}"][0] for i in (1, 2, 3)},
            "end_effector_x": physics.named.data.site_xpos["end_effector", "x"],
            "end_effector_y": physics.named.data.site_xpos["end_effector", "y"],
        }
        np.testing.assert_allclose(
            features, [expected[name] for group in task.observation for name in group.parts], atol=1e-12
        )


def test_a_page_can_describe_this_arm(tmp_path):
    """docs/task-in-python.md says so, and what a page leaves out."""
    model = files("tltlrl.tasks.planar_arm").joinpath("arm.xml").read_text(encoding="utf-8")
    (tmp_path / "arm.xml").write_text(model.replace('ctrllimited="true"', 'ctrlrange="-2 2"'))
    (tmp_path / "arm.yaml").write_text(PAGE)
    tasks = PlanarArm(ARM), Robot(config_of(tmp_path / "arm.yaml"))
    rng = np.random.default_rng(0)
    offsets, noise = 2 * rng.normal(size=(2, 5, 200, 3))
    said = []
    for task in tasks:
        held = np.einsum("dn,tn->td", task.feedback, task.reference()[0])
        motion = Simulator(task).rollout(-task.feedback, offsets + held, task.command_noise * noise)
        said.append(task.signals(motion.features, motion.commands))
    assert said[0].keys() == said[1].keys()
    for name in said[0]:
        np.testing.assert_allclose(said[0][name], said[1][name], rtol=0, atol=1e-9)


def test_link_lengths_reach_model_and_kinematics():
    task = PlanarArm(replace(ARM, link_lengths=[0.5, 1.5, 0.25]))
    physics = task.make_physics()
    physics.data.qpos[:] = [0.1, -0.7, 1.3]
    physics.forward()
    np.testing.assert_allclose(
        forward_kinematics(np.array([0.1, -0.7, 1.3]), np.array([0.5, 1.5, 0.25])), physics.end_effector(), atol=1e-12
    )


def test_command_limit_reaches_the_model():
    physics = PlanarArm(replace(ARM, max_speed=1.25)).make_physics()
    np.testing.assert_array_equal(physics.model.actuator_ctrlrange, [[-1.25, 1.25]] * 3)


def end_effector_path(timestep, commands):
    model = arm_model([1.0, 1.0, 1.0], 2.0)
    model.opt.timestep = timestep or model.opt.timestep
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    path = []
    for command in commands:
        data.ctrl[:] = command
        mujoco.mj_step(model, data, round(PlanarArm.control_timestep / model.opt.timestep))
        path.append(forward_kinematics(data.qpos.copy(), np.ones(3)))
    return np.array(path)


@pytest.mark.parametrize("seed", range(3))
def test_timestep_is_short_enough(seed):
    """Within 1 cm of a simulation with a timestep of 0.5 ms, over 200 random steps."""
    commands = np.random.default_rng(seed).normal(0, 2, size=(200, 3))
    error = np.linalg.norm(end_effector_path(None, commands) - end_effector_path(0.0005, commands), axis=1)
    assert error.max() < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_servo_is_fast_enough(seed):
    """Most of a changed command is reached within one control step."""
    rng = np.random.default_rng(seed)
    model = arm_model([1.0, 1.0, 1.0], 2.0)
    data = mujoco.MjData(model)
    data.qpos[:] = rng.uniform(-1, 1, 3)
    command = rng.uniform(-2, 2, 3)
    data.ctrl[:] = command
    mujoco.mj_step(model, data, round(PlanarArm.control_timestep / model.opt.timestep))
    np.testing.assert_allclose(data.qvel, command, atol=0.1)


def test_reach_avoid_rewards_are_equation_3_2():
    rewards = reach_avoid_rewards(replace(REACH_AVOID, goal=5, obstacle=-2, c1=1.0, c2=0.25), CONSTANTS)
    ee = np.array([[[-1.2, 1.59], [0.3, 2.4], [-0.6, 0.3], [2.0, 2.0]]])  # at the goal, in obstacle 1, in 2, free
    np.testing.assert_array_equal(rewards["discrete"]({"ee": ee})[0], [[5.0, -2.0, -2.0, 0.0]])
    for point, value in zip(ee[0], rewards["continuous"]({"ee": ee})[0][0], strict=True):
        d_g = np.hypot(*(point - [-1.2, 1.4]))
        d_o1, d_o2 = np.hypot(*(point - [0.3, 2.0])), np.hypot(*(point - [-0.6, 0.6]))
        np.testing.assert_allclose(value, -1.0 * d_g + 0.25 * (d_o1 + d_o2))


def test_rewards_say_which_constants_of_the_spec_they_miss():
    missing = r"need its constants goal \(a vector\), goal_radius \(a number\); it has target"
    with pytest.raises(UserError, match=missing):
        reach_avoid_rewards(REACH_AVOID, {"target": (0.0, 0.0)})


R, G, B, FREE, IN_OBSTACLE = (0.2, 2.2), (-1.6, 1.2), (1.6, 0.6), (2.5, 0.0), (0.0, 0.9)
IN_ORDER = {
    "goal": {"r": R, "g": G, "b": B},
    "goal_radius": 0.2,
    "obstacle": {"1": (-0.7, 2.2), "2": IN_OBSTACLE, "3": (1.4, 1.5)},
    "obstacle_radius": {"1": 0.35, "2": 0.4, "3": 0.3},
}


@pytest.mark.parametrize(
    ("path", "rewards"),
    [
        pytest.param([FREE, R, FREE, G, FREE, B, FREE], [0, 5, 0, 5, 0, 5, 0], id="right order"),
        pytest.param([R, G, B], [5, 5, 5], id="right order without a pause, from the first sample"),
        pytest.param([R, R, R, G], [5, 0, 0, 5], id="staying is worth nothing"),
        pytest.param([G, FREE, R, G], [-5, 0, 5, 5], id="too early, then right"),
        pytest.param([B, G, R], [-5, -5, 5], id="wrong order"),
        pytest.param([R, FREE, R, FREE, G], [5, 0, -5, 0, 5], id="revisit"),
        pytest.param([R, G, B, FREE, R, B], [5, 5, 5, 0, -5, -5], id="revisits after the last"),
        pytest.param([IN_OBSTACLE, R, IN_OBSTACLE, IN_OBSTACLE], [-2, 5, -2, -2], id="obstacles"),
    ],
)
def test_visit_in_order_discrete_is_equation_3_5_with_its_memory(path, rewards):
    discrete = visit_in_order_rewards(VISIT_IN_ORDER, IN_ORDER)["discrete"]
    np.testing.assert_array_equal(discrete({"ee": np.array([path])})[0], [rewards])


def test_visit_in_order_continuous_is_equation_3_5_with_its_memory():
    coefficients = replace(VISIT_IN_ORDER, c1=1.0, c2=0.3, c3=0.2)
    continuous = visit_in_order_rewards(coefficients, IN_ORDER)["continuous"]
    path = np.array([FREE, R, FREE, G, B, FREE])
    following = ["r", "r", "g", "g", "b", None]  # the goal to go for at each sample: visits count from the next on
    for point, following_goal, value in zip(path, following, continuous({"ee": path[None]})[0][0], strict=True):
        d_g = {name: np.hypot(*(point - np.array(goal))) for name, goal in IN_ORDER["goal"].items()}
        d_o = [np.hypot(*(point - np.array(centre))) for centre in IN_ORDER["obstacle"].values()]
        towards = d_g.pop(following_goal) if following_goal else 0.0
        np.testing.assert_allclose(value, -1.0 * towards + 0.3 * sum(d_g.values()) + 0.2 * sum(d_o))


def test_the_environments_reward_remembers_the_episode():
    """Stepping gives, sample by sample, what the batch gives at once."""
    rewards = visit_in_order_rewards(VISIT_IN_ORDER, IN_ORDER | {"goal_radius": 0.6})
    env = environment(PlanarArm(replace(ARM, steps=80, command_noise=0.0)), rewards["discrete"])
    timestep = env.reset()
    path, stepped = [timestep.observation["end_effector"]], []
    rng = np.random.default_rng(4)
    while not timestep.last():
        timestep = env.step(rng.normal([0.4, 0.2, 0.6], 1.5))
        path.append(timestep.observation["end_effector"])
        stepped.append(timestep.reward)
    batch = rewards["discrete"]({"ee": np.array([path])})[0][0]
    np.testing.assert_array_equal(batch[1:], stepped)
    assert {5.0, -5.0} <= set(stepped)  # the walk is long enough to mean something


def test_wrong_settings_are_told():
    for change, message in (
        ({"link_lengths": [1.0, 1.0]}, r"task.link_lengths: \[1.0, 1.0\] must be three positive lengths, m"),
        ({"link_lengths": [1.0, 0.0, 1.0]}, "task.link_lengths: 0.0 is too small; it must be above 0"),
        ({"start_angles": [0.0]}, r"task.start_angles: \[0.0\] must be three angles, rad"),
        ({"max_speed": 0.0}, "task.max_speed: 0.0 is too small; it must be above 0"),
        ({"command_noise": -0.1}, "task.command_noise: -0.1 is too small; it must be at least 0"),
        ({"command_noise": float("nan")}, "task.command_noise: nan is not a finite number"),
        ({"steps": 1}, "task.steps: 1 is too small; it must be at least 2"),
        ({"steps": 100_001}, "task.steps: 100001 is too large; it must be at most 100000"),
    ):
        with pytest.raises(UserError, match=f"^{message}$"):
            replace(ARM, **change)


def test_the_skeleton_ends_where_the_end_effector_is():
    task = PlanarArm(replace(ARM, link_lengths=[0.5, 1.5, 0.25]))
    features = task.features(np.random.default_rng(0).normal(size=(7, 3)), np.zeros((7, 3)))
    points = task.skeleton(features)
    assert points.shape == (7, 4, 2)
    np.testing.assert_array_equal(points[:, 0], 0.0)
    np.testing.assert_allclose(points[:, -1], features[:, task.slices["end_effector"]], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=1), axis=2), [[0.5, 1.5, 0.25]] * 7)
