"""A robot from an MJCF file and a page: its features, signals and motions, beside MuJoCo's own computation."""

import mujoco
import numpy as np
import pytest
from robots import ARM, MODELS

from tltlrl.errors import UserError
from tltlrl.logic import parse_spec
from tltlrl.simulation.check_task import check_task
from tltlrl.simulation.motion import effort, measures, path_length, smoothness
from tltlrl.simulation.probe import ranges_seen
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.stepping import Stepper
from tltlrl.tasks.environment import environment
from tltlrl.tasks.mjcf.evaluation import evaluation_of
from tltlrl.tasks.mjcf.file import config_of
from tltlrl.tasks.mjcf.robot import Robot

PAGE = """\
model: arm.xml
duration: 0.6
keyframe: home
start: {shoulder: 0.5}
feedback: {elbow: [-1, -0.1]}
reference: [{time: 0.3, shoulder: 0.8}, {time: 0.5, shoulder: 0.3, elbow: 1}]
"""
SIGNALS = """\
signals:
  tip: site_xpos.tip
  angles: [qpos.shoulder, qpos.elbow]
  height: site_xpos.tip.z
  force: sensordata.touch
  shaking: sensordata.shaking
  velocity: site_xvelp.tip
  turning: xvelr.fore
  orientation: site_xmat.tip
  quaternion: geom_xquat.fore
  gap: distance.fore.floor
  push: contact_force.fore.floor
  torque: actuator_force.elbow
  puck: [qpos.puck, qvel.puck]
"""


@pytest.fixture
def robot(tmp_path):
    """Makes a robot of a page, beside the models."""
    for name, text in MODELS.items():
        (tmp_path / name).write_text(text)

    def make(page, evaluation=False):
        (tmp_path / "arm.yaml").write_text(page)
        config = config_of(tmp_path / "arm.yaml")
        return Robot(evaluation_of(config) if evaluation else config)

    return make


@pytest.mark.parametrize(
    "page",
    [
        PAGE + SIGNALS,
        PAGE,
        "model: arm.xml\nduration: 0.5\nspread: 0.1\ncommands: [elbow]\nends_when: qpos[0] > 0.3\n",
        "model: dm_control:suite/cartpole.xml\nduration: 0.4\ncontrol_timestep: 0.02\n",
    ],
)
def test_it_keeps_the_contract_of_a_task(robot, page):
    """So the batched rollout and the dm_env view agree to 1e-9, in contact, too."""
    check_task(robot(page))


def test_its_signals_are_dm_controls_quantities(robot):
    task = robot(PAGE + SIGNALS)
    env = environment(task, noise=False)
    env.reset()
    rng = np.random.default_rng(0)
    for _ in range(8):
        step = env.step(task.command_scale * rng.uniform(-1, 1, 2))
        physics = env.physics
        features = np.concatenate(list(step.observation.values()))[None, None]
        signals = {name: values[0, 0] for name, values in task.signals(features, np.zeros((1, 1, 2))).items()}
        data = physics.named.data
        velocity = np.zeros(6)
        site = physics.model.name2id("tip", "site")
        mujoco.mj_objectVelocity(physics.model.ptr, physics.data.ptr, mujoco.mjtObj.mjOBJ_SITE, site, velocity, 0)
        expected = {
            "tip": data.site_xpos["tip"],
            "angles": data.qpos[["shoulder", "elbow"]],
            "height": data.site_xpos["tip", "z"],
            "force": data.sensordata["touch"],
            "shaking": data.sensordata["shaking"],
            "velocity": velocity[3:],
            "orientation": data.site_xmat["tip"],
            "puck": np.concatenate([data.qpos["puck"], data.qvel["puck"]]),
        }
        for name, value in expected.items():
            np.testing.assert_allclose(signals[name], np.squeeze(value), rtol=0, atol=1e-12, err_msg=name)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, signals["quaternion"])
        np.testing.assert_allclose(rotation, data.geom_xmat["fore"], atol=1e-9)


def test_without_signals_it_has_its_sensors_positions_velocities_and_commands(robot):
    task = robot(PAGE)
    features, commands = task.reference()
    signals = task.signals(features[None], commands[None])
    assert {name: values.shape[2:] for name, values in signals.items()} == {
        "qpos": (9,), "qvel": (8,), "touch": (), "shaking": (3,), "command": (2,),
    }  # fmt: skip


def test_its_motion_is_measured_by_the_joints_that_it_drives_and_its_first_position(robot):
    """And not by a puck that lies about."""
    task = robot(PAGE + SIGNALS)
    offsets = np.random.default_rng(0).uniform(-1, 1, (1, task.steps, 2))
    simulator = Simulator(task)
    motion = simulator.rollout(task.feedback, offsets, 0 * offsets)
    signals = task.signals(motion.features, motion.commands)
    found = measures(task, parse_spec("signal height\nspec: F height > 9"), motion, simulator.command_range)
    velocities = motion.features[0][:, task.slices["qvel"]][:, :2]  # shoulder and elbow
    expected = smoothness(velocities, task.control_timestep)
    expected |= effort(motion.commands[0, :-1], task.command_scale, *simulator.command_range)
    expected |= {"path_length": path_length(signals["tip"][0])}
    assert found.pop("time_to_satisfaction") is None
    assert found == pytest.approx(expected)
    without = robot("model: arm.xml\ncommands: [elbow]\nsignals: {height: site_xpos.tip.z, velocity: site_xvelp.tip}\n")
    assert without.end_effector is None
    elbow = len(without.observation[0].parts) + 1  # after all positions and the shoulder
    assert without.joint_velocities.tolist() == [elbow]


def test_a_reference_passes_its_waypoints_and_its_commands_hold_it(robot):
    task = robot(PAGE)
    features, _ = task.reference()
    times = [0.0, 0.3, 0.5]
    samples = np.arange(task.steps) * task.control_timestep
    np.testing.assert_allclose(features[:, 0], np.interp(samples, times, [0.5, 0.8, 0.3]), atol=1e-12)
    np.testing.assert_allclose(features[:, 1], np.interp(samples, times, [0.4, 0.4, 1.0]), atol=1e-12)
    held = robot("model: no_key.xml\nduration: 1.0\nstart: {shoulder: 0.1, elbow: -0.2, puck: [1, 1, 0, 1, 0, 0, 0]}\n")
    commands = held.reference()[1]
    assert np.all(np.abs(commands) < held.command_scale)
    motion = Simulator(held).rollout(0 * held.feedback, commands[None], 0 * commands[None])
    assert np.abs(motion.features[0, :, :2] - motion.features[0, 0, :2]).max() < 1e-6


def test_robots_that_are_stepped_one_command_at_a_time_move_as_in_the_rollout(robot):
    task = robot(PAGE + SIGNALS)
    commands = task.command_scale * np.random.default_rng(0).uniform(-1, 1, (2, task.steps, 2))
    motion = Simulator(task).rollout(0 * task.feedback, commands, 0 * commands)
    stepper = Stepper(task, 2)
    for t in range(task.steps):
        np.testing.assert_array_equal(stepper.features, motion.features[:, t])
        stepper.step(commands[:, t])


def test_starts_have_their_spread_and_nothing_is_drawn_without_it(robot):
    task = robot("model: arm.xml\nduration: 0.2\nspread: 0.1\n")
    starts = Simulator(task).draw_starts(2000, np.random.default_rng(0))
    assert starts.shape == (2000, 8)
    np.testing.assert_allclose(starts.std(axis=0), 0.1, rtol=0.1)
    zeros = np.zeros((2, task.steps, 2))
    motion = Simulator(task).rollout(task.feedback, zeros, zeros, starts[:2])
    np.testing.assert_allclose(motion.features[:, 0, :2], starts[:2, :2])
    rng = np.random.default_rng(0)
    assert Simulator(robot(PAGE)).draw_starts(5, rng) is None
    assert rng.bit_generator.state == np.random.default_rng(0).bit_generator.state


def test_actuators_that_are_not_commanded_are_taken_out(robot):
    task = robot("model: arm.xml\ncommands: [elbow]\n")
    assert task.make_physics().model.nu == 1
    assert task.action[0].parts == ("elbow",)
    assert task.command_scale == [1.0]


def test_actuators_and_joints_without_a_name_are_called_by_their_numbers(robot, tmp_path):
    """Also where the one before is taken out, and where they are measured."""
    nameless = ARM.replace(' name="shoulder"', "").replace(' name="elbow"', "").replace(' joint="elbow"', ' joint="b"')
    nameless = nameless.replace("<joint axis", '<joint name="b" axis').replace('name="b" ', "", 1)
    nameless = nameless.replace('<position joint="shoulder" kp', '<position joint="b" kp')
    (tmp_path / "nameless.xml").write_text(nameless)
    page = "model: {}.xml\nduration: 0.5\ncommands: [{}]\nfeedback: {{{}: -1}}\n"
    signals = "signals: {{torque: actuator_force.{}, first: qpos.{}}}\n"
    elbows = (page + signals).format("nameless", *["actuator_1"] * 3, "joint_0")
    tasks = robot(elbows), robot((page + signals).format("arm", *["elbow"] * 3, "shoulder"))
    offsets = np.random.default_rng(0).uniform(-1, 1, (2, tasks[0].steps, 1))
    motions = [Simulator(task).rollout(task.feedback, offsets, 0 * offsets) for task in tasks]
    np.testing.assert_array_equal(*(motion.features for motion in motions))
    assert tasks[0].action[0].parts == ("actuator_1",)


def test_an_episode_ends_where_the_page_says(robot):
    task = robot("model: arm.xml\nduration: 1.0\nsignals: {tip: site_xpos.tip}\nends_when: tip.z < -0.2\n")
    zeros = np.zeros((1, task.steps, 2))
    motion = Simulator(task).rollout(0 * task.feedback, zeros, zeros)
    height = task.signals(motion.features, motion.commands)["tip"][0, : motion.lengths[0], 2]
    assert motion.lengths[0] < task.steps
    assert np.all(height[:-1] >= -0.2)
    assert height[-1] < -0.2


def test_the_scene_of_the_evaluation_may_hold_more(robot, tmp_path):
    lid = '<body name="lid" pos="2 0 0"><freejoint name="lid"/><geom size=".1"/></body>'
    more = ARM.replace('<body name="puck"', f'{lid}<body name="puck"').replace("0.2 0.4", "0.2 0.4 2 0 0 1 0 0 0")
    page = PAGE + SIGNALS + "evaluation: {model: solid.xml, command_noise: 0.05}\n"
    (tmp_path / "solid.xml").write_text(more)
    trained = robot(page)
    task = robot(page, evaluation=True)
    check_task(task)
    assert task.make_physics().model.nq == trained.make_physics().model.nq + 7
    assert task.observation == trained.observation
    np.testing.assert_allclose(task.command_noise, 0.05 * task.command_scale)


def test_a_simulation_that_diverges_says_when_and_what_helps(robot, tmp_path, monkeypatch):
    wild = ARM.replace('gear="10"', 'gear="1e7"').replace('damping=".5" range="-150 150"', "")
    (tmp_path / "wild.xml").write_text(wild)
    task = robot("model: wild.xml\nduration: 1.0\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError) as error:
        ranges_seen(task, np.random.default_rng(0))
    assert str(error.value).startswith(
        "task: under random commands of full size the simulation of arm diverged: trajectory "
    )
    assert str(error.value).endswith(
        " s; a smaller timestep of the model, more damping or armature in its joints, or a smaller ctrlrange of its "
        "actuators usually helps"
    )
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_a_model_that_was_changed_is_noticed_with_the_files_that_it_names(robot, tmp_path):
    (tmp_path / "main.xml").write_text('<mujoco><include file="arm_body.xml"/></mujoco>')
    (tmp_path / "arm_body.xml").write_text(ARM)
    task = robot("model: main.xml\n")
    Robot(task.config)
    (tmp_path / "arm_body.xml").write_text(ARM.replace('gear="10"', 'gear="11"'))
    with pytest.raises(UserError, match=r"arm\.yaml:1: model: the model, or a file that it names, was changed"):
        Robot(task.config)


def test_an_actuator_that_a_page_adds_is_as_one_of_the_model(robot):
    """Two of its kinds, beside those that the MJCF file has."""
    added = (
        "actuators: {shoulder: {position: 60, damping: 6, range: 2}, elbow: {motor: 10, range: [-1, 1]}}\n"
        "keyframe: home\nduration: 0.5\n"
    )
    tasks = [robot("model: arm.xml\nkeyframe: home\nduration: 0.5\n"), robot("model: bare.xml\n" + added)]
    offsets = np.random.default_rng(0).uniform(-1, 1, (2, tasks[0].steps, 2)) * tasks[0].command_scale
    motions = [Simulator(task).rollout(0 * task.feedback, offsets, 0 * offsets) for task in tasks]
    np.testing.assert_array_equal(*(motion.features[..., :18] for motion in motions))
    assert tasks[1].action[0].parts == ("shoulder", "elbow")


def test_the_force_of_an_added_actuator_is_limited(robot):
    task = robot(
        "model: bare.xml\nactuators: {elbow: {velocity: 50, range: 1, force: 0.25}}\n"
        "signals: {torque: actuator_force.elbow}\nduration: 0.5\n"
    )
    offsets = np.full((1, task.steps, 1), 1.0)
    motion = Simulator(task).rollout(0 * task.feedback, offsets, 0 * offsets)
    assert np.abs(task.signals(motion.features, motion.commands)["torque"]).max() == 0.25


def test_an_actuator_can_be_told_of_other_joints(robot):
    task = robot("model: arm.xml\nfeedback: {elbow: {shoulder: [0.3, 0.2], elbow: -1}}\n")
    names = [part for group in task.observation for part in group.parts]
    assert dict(zip(names, -task.feedback[1], strict=True)) == dict.fromkeys(names, 0.0) | {
        "qpos.shoulder": 0.3,
        "qvel.shoulder": 0.2,
        "qpos.elbow": -1.0,
    }
