"""The arm: its table, its kinematics, its servo, its rewards."""

import re

import mujoco
import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.tasks import planar_arm
from tltlrl.tasks.planar_arm import PlanarArm, PlanarArmConfig, ReachAvoidReward, forward_kinematics, model_xml
from tltlrl.tasks.task import CONTROL_TIMESTEP

CONSTANTS = {
    "goal": (-1.2, 1.4),
    "goal_radius": 0.2,
    "obstacle": {"1": (0.3, 2.0), "2": (-0.6, 0.6)},
    "obstacle_radius": {"1": 0.5, "2": 0.4},
}


def test_observation_table_of_the_docstring_is_the_code():
    rows = re.findall(r"^\| (\d) \| (\w+) \| (\S+) \|$", planar_arm.__doc__, flags=re.MULTILINE)
    assert [(int(i), name, unit) for i, name, unit in rows] == [
        (i, quantity.name, quantity.unit) for i, quantity in enumerate(PlanarArm.observation)
    ]


def test_each_feature_is_the_quantity_that_the_table_says():
    task = PlanarArm(PlanarArmConfig(), {})
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
        np.testing.assert_allclose(features, [expected[q.name] for q in task.observation], atol=1e-12)


def test_link_lengths_reach_model_and_kinematics():
    task = PlanarArm(PlanarArmConfig(link_lengths=[0.5, 1.5, 0.25]), {})
    physics = task.make_physics()
    physics.data.qpos[:] = [0.1, -0.7, 1.3]
    physics.forward()
    np.testing.assert_allclose(
        forward_kinematics(np.array([0.1, -0.7, 1.3]), np.array([0.5, 1.5, 0.25])), physics.end_effector(), atol=1e-12
    )


def test_command_limit_reaches_the_model():
    physics = PlanarArm(PlanarArmConfig(max_speed=1.25), {}).make_physics()
    np.testing.assert_array_equal(physics.model.actuator_ctrlrange, [[-1.25, 1.25]] * 3)


def end_effector_path(timestep, commands):
    model = mujoco.MjModel.from_xml_string(model_xml([1.0, 1.0, 1.0], 2.0))
    model.opt.timestep = timestep or model.opt.timestep
    data = mujoco.MjData(model)
    data.qpos[:] = 0.5
    path = []
    for command in commands:
        data.ctrl[:] = command
        mujoco.mj_step(model, data, round(CONTROL_TIMESTEP / model.opt.timestep))
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
    model = mujoco.MjModel.from_xml_string(model_xml([1.0, 1.0, 1.0], 2.0))
    data = mujoco.MjData(model)
    data.qpos[:] = rng.uniform(-1, 1, 3)
    command = rng.uniform(-2, 2, 3)
    data.ctrl[:] = command
    mujoco.mj_step(model, data, round(CONTROL_TIMESTEP / model.opt.timestep))
    np.testing.assert_allclose(data.qvel, command, atol=0.1)


def test_reach_avoid_rewards_are_equation_3_2():
    rewards = planar_arm.reach_avoid_rewards(ReachAvoidReward(goal=5, obstacle=-2, c1=1.0, c2=0.25), CONSTANTS)
    ee = np.array([[-1.2, 1.59], [0.3, 2.4], [-0.6, 0.3], [2.0, 2.0]])  # at the goal, in obstacle 1, in 2, free
    np.testing.assert_array_equal(rewards["discrete"]({"ee": ee}), [5.0, -2.0, -2.0, 0.0])
    for point, value in zip(ee, rewards["continuous"]({"ee": ee}), strict=True):
        d_g = np.hypot(*(point - [-1.2, 1.4]))
        d_o1, d_o2 = np.hypot(*(point - [0.3, 2.0])), np.hypot(*(point - [-0.6, 0.6]))
        np.testing.assert_allclose(value, -1.0 * d_g + 0.25 * (d_o1 + d_o2))


def test_rewards_say_which_constants_of_the_spec_they_miss():
    with pytest.raises(UserError, match=r"need the spec's constants .* this spec has: target"):
        planar_arm.reach_avoid_rewards(ReachAvoidReward(), {"target": (0.0, 0.0)})
