"""The arm against its published description, the batched rollout against dm_env, eq. 3.9 and the bread."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tltlrl.errors import UserError
from tltlrl.logic import load_spec
from tltlrl.resources import spec_path
from tltlrl.simulation.rollout import Simulator
from tltlrl.tasks.environment import environment
from tltlrl.tasks.toast import scene as toast
from tltlrl.tasks.toast.rewards import ToastReward, closest_before, toast_rewards

CONSTANTS = {"slot_centre": (0.70, -0.35, 0.05), "toaster_centre": (0.70, -0.35, -0.105)}
TOAST, REWARD = toast.ToastConfig(), ToastReward()
HALF_PI = np.pi / 2
INTO_SLOT = [  # waypoints of a motion that comes down where the slot is
    [0.6596, -0.3849, -0.7403, 1.4209, 0.9226, 0.9014, -1.1426],
    [1.2677, -0.8194, -1.0383, 1.4059, 0.6475, 1.3470, -0.5761],
    [1.2024, -0.6364, -0.8936, 1.5043, 0.7856, 1.0891, -0.6536],
]

# Origin (m) and roll, pitch, yaw (fixed axes) of each joint's frame in its parent's; range (rad), speed (rad/s),
# effort (N m).
PUBLISHED = {
    "s0": ((0.055695, 0, 0.011038), (0, 0, 0), (-1.70167993878, 1.70167993878), 1.5, 50),
    "s1": ((0.069, 0, 0.27035), (-HALF_PI, 0, 0), (-2.147, 1.047), 1.5, 50),
    "e0": ((0.102, 0, 0), (HALF_PI, 0, HALF_PI), (-3.05417993878, 3.05417993878), 1.5, 50),
    "e1": ((0.069, 0, 0.26242), (-HALF_PI, -HALF_PI, 0), (-0.05, 2.618), 1.5, 50),
    "w0": ((0.10359, 0, 0), (HALF_PI, 0, HALF_PI), (-3.059, 3.059), 4.0, 15),
    "w1": ((0.01, 0, 0.2707), (-HALF_PI, -HALF_PI, 0), (-1.57079632679, 2.094), 4.0, 15),
    "w2": ((0.115975, 0, 0), (HALF_PI, 0, HALF_PI), (-3.059, 3.059), 4.0, 15),
}
# Mass (kg), centre of mass (m), and ixx iyy izz ixy ixz iyz about it (kg m^2), in the link's frame.
INERTIAS = {
    "right_upper_shoulder": (
        5.70044,
        (0.01783, 0.00086, 0.19127),
        (0.04709102262, 0.03766976455, 0.03595988478, 0.00012787556, 0.00614870039, 0.00078086899),
    ),
    "right_lower_shoulder": (
        3.22698,
        (0.06845, 0.00269, -0.00529),
        (0.01175209419, 0.0278859752, 0.02078749298, -0.00030096398, 0.00207675762, -0.00018821993),
    ),
    "right_upper_elbow": (
        4.31272,
        (-0.00276, 0.00132, 0.18086),
        (0.02661733557, 0.02844355207, 0.01248008322, 0.00029270634, 0.00392189887, 0.0010838933),
    ),
    "right_lower_elbow": (
        2.07206,
        (0.02611, 0.00159, -0.01117),
        (0.00711582686, 0.01318227876, 0.00926852064, 0.00036036173, 0.0007459496, -0.00019663418),
    ),
    "right_upper_forearm": (
        2.24665,
        (-0.00168, 0.0046, 0.13952),
        (0.01667742825, 0.01675457264, 0.0037463115, 0.00018403705, 0.00018657629, -0.00064732352),
    ),
    "right_lower_forearm": (
        1.60979,
        (0.06041, 0.00697, 0.006),
        (0.00387607152, 0.00700537914, 0.0055275524, -0.00044384784, -0.00021115038, 0.00015348067),
    ),
    "right_wrist": (
        0.35093,
        (0.00198, 0.00125, 0.01855),
        (0.00025289155, 0.0002688601, 0.0003074118, 0.00000575311, -0.00000159345, -0.00000519818),
    ),
    "right_hand": (
        0.19125,
        (0.01093, 0.00042, -0.01532),
        (0.00017588, 0.00021166377, 0.00023745397, 0.00000147073, 0.0000243633, 0.00000172689),
    ),
}


def make_task(**changes: object) -> toast.Toast:
    return toast.Toast(replace(TOAST, **{"command_noise": 0.0} | changes))


@pytest.fixture(scope="module")
def physics() -> toast.Physics:
    return make_task().make_physics()


def published_hand(angles: np.ndarray) -> np.ndarray:
    """Pose (4, 4) of right_hand in right_arm_mount by elementary rotations alone."""
    pose = np.eye(4)
    for angle, (origin, (roll, pitch, yaw), *_) in zip(angles, PUBLISHED.values(), strict=True):
        step = np.eye(4)
        step[:3, :3] = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll) @ turn(2, angle)
        step[:3, 3] = origin
        pose = pose @ step
    return pose @ np.block([[np.eye(3), np.array([[0], [0], [0.11355]])], [np.zeros(3), 1]])


def turn(axis: int, angle: float) -> np.ndarray:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i], matrix[i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def pose_in_mount(physics: toast.Physics) -> np.ndarray:
    def world(body: str) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, :3] = physics.named.data.xmat[body].reshape(3, 3)
        pose[:3, 3] = physics.named.data.xpos[body]
        return pose

    return np.linalg.solve(world("right_arm_mount"), world("right_hand"))


def flat(time_step: object) -> np.ndarray:
    return np.concatenate([np.ravel(value) for value in time_step.observation.values()])  # type: ignore[attr-defined]


def unwrapped(difference: np.ndarray) -> np.ndarray:
    """Differences of features, with those of roll and yaw modulo a full turn."""
    difference[..., [17, 19]] = (difference[..., [17, 19]] + np.pi) % (2 * np.pi) - np.pi
    return difference


def test_observation_table_is_the_code() -> None:
    rows = re.findall(r"^\| (\d+) \| (\w+) \| (\S+) \|$", toast.__doc__ or "", re.MULTILINE)
    parts = [(name, group.unit) for group in toast.Toast.observation for name in group.parts]
    expected = [(str(i), *part) for i, part in enumerate(parts)]
    assert rows == expected
    assert len(rows) == 21
    assert sum(len(group.parts) for group in toast.Toast.action) == 8


def test_forward_kinematics_is_the_published_arm(physics: toast.Physics) -> None:
    rng = np.random.default_rng(0)
    low, high = np.array([row[2] for row in PUBLISHED.values()]).T
    for angles in [np.zeros(7), *rng.uniform(low, high, (50, 7))]:
        with physics.reset_context():
            physics.data.qpos[:7] = angles
        np.testing.assert_allclose(pose_in_mount(physics), published_hand(angles), atol=1e-12)
    stretched = published_hand(np.zeros(7))
    np.testing.assert_allclose(stretched[:3, 3], [1.09293, 0, 0.202388], atol=1e-6)
    np.testing.assert_allclose(stretched[:3, 2], [1, 0, 0], atol=1e-12)


def test_limits_are_the_published_ones(physics: toast.Physics) -> None:
    for name, (_, _, joint_range, speed, effort) in PUBLISHED.items():
        joint = f"right_{name}"
        np.testing.assert_array_equal(physics.named.model.jnt_range[joint], joint_range)
        np.testing.assert_array_equal(physics.named.model.actuator_ctrlrange[joint], [-speed, speed])
        np.testing.assert_array_equal(physics.named.model.actuator_forcerange[joint], [-effort, effort])
        np.testing.assert_array_equal(physics.named.model.jnt_actfrcrange[joint], [-effort, effort])
    np.testing.assert_array_equal(physics.named.model.actuator_ctrlrange["right_gripper"], [0, 100])


@pytest.mark.parametrize("body", INERTIAS)
def test_mass_centre_and_inertia_are_the_published_ones(physics: toast.Physics, body: str) -> None:
    mass, centre, (xx, yy, zz, xy, xz, yz) = INERTIAS[body]
    model = physics.named.model
    assert model.body_mass[body] == mass
    np.testing.assert_array_equal(model.body_ipos[body], centre)
    orientation = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
    tensor = orientation @ np.diag(model.body_inertia[body]) @ orientation.T
    np.testing.assert_allclose(tensor, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], atol=1e-12)


def test_the_specs_regions_are_where_the_scene_has_them(physics: toast.Physics) -> None:
    for name in ("toast", "toast_eq37", "toast_smooth", "toast_gentle"):
        constants = load_spec(spec_path(name)).constants
        assert constants["slice_below"] == toast.BREAD_REACH
        assert constants["table_height"] == toast.TABLE_HEIGHT == physics.named.data.geom_xpos["table", "z"] + 0.02
        np.testing.assert_array_equal(constants["toaster_centre"], physics.named.data.xpos["toaster"])


DOWN = np.array([[0.7, -0.35, 0.05 + above] for above in (0.14, 0.11, 0.08, 0.04, 0.01, -0.01, -0.01, -0.01)])


def gentle_signals(**changed: np.ndarray) -> dict[str, np.ndarray]:
    """Straight down into the slot, where the gripper is, when it opens; (N, 8) samples."""
    held = np.repeat([0.0, 100.0], [4, 4])
    own = {"ee": DOWN[None], "rotation": np.zeros((1, 8, 3)), "gripper": held[None]}
    return own | changed


def test_a_tilt_moves_the_slices_foot_as_the_gentle_spec_says() -> None:
    """Of tilted hands at the slot, in the directions of `fits`; and a corner sinks as `table` says."""
    near = np.array([1.1548, -0.6221, -0.9009, 1.4833, 0.7952, 1.1021, -0.6967])
    angles = near + np.random.default_rng(0).normal(0, [0, 0, 0, 0, 0.1, 0.1, 0.1], (200, 7))
    position, turned = toast.forward_kinematics(angles)
    rotation = toast.rotation_from_release(toast.roll_pitch_yaw(turned))
    foot = position + turned @ [0, 0, toast.BREAD_REACH]
    assert np.abs(rotation[:, :2]).max(axis=0).min() > 0.15
    np.testing.assert_allclose(foot[:, :2], position[:, :2] - 0.09 * rotation[:, [1, 0]], atol=5e-3)
    corners = np.stack([foot + turned @ [side, 0, 0] for side in (-0.06, 0.06)])
    lowest = position[:, 2] - 0.09 - 0.06 * np.abs(rotation[:, 1])
    np.testing.assert_allclose(corners[..., 2].min(axis=0), lowest, atol=6e-3)


def test_what_satisfies_the_gentle_spec_satisfies_the_other() -> None:
    rng = np.random.default_rng(2)
    own, gentle = load_spec(spec_path("toast")), load_spec(spec_path("toast_gentle"))
    ee = DOWN + rng.normal(0, 0.007, (4000, 8, 3))
    gripper = np.repeat([0.0, 100.0], [4, 4]) + rng.normal(0, 20, ee.shape[:2])
    signals = gentle_signals(ee=ee, rotation=rng.normal(0, 0.05, ee.shape), gripper=gripper)
    robustness, of_own = gentle.robustness(signals), own.robustness(signals)
    assert np.all(robustness <= of_own + 1e-12)
    assert np.mean(robustness > 0) > 0.05
    assert np.mean((robustness < 0) & (of_own > 0)) > 0.05


@pytest.mark.parametrize(
    ("change", "decides", "value"),
    [
        ("nothing", "", 0.01),  # a step of 4 cm
        ("fast", "G gentle", -0.01),
        ("from the side", "!slot U above", -0.015),
        ("tilted in the slot", "!slot U (slot & fits)", 25 / 18 * (0.018 - 0.09 * 0.25)),
        ("tilted against the gripper's place", "!slot U (slot & fits)", 25 / 18 * (0.018 - 0.015 - 0.09 * 0.15)),
        ("tilted across", "!slot U (slot & fits)", 25 / 18 * (0.018 - 0.015 - 0.09 * 0.15)),
        ("tilted above the table", "G !(table | toaster)", 2.5 * (0.01 - 0.06 * 0.2)),
        ("tilted beside the slot", "G !(table | toaster)", -0.007),
    ],
)
def test_the_gentle_spec_asks_for_more(change: str, decides: str, value: float) -> None:
    """Of a motion that satisfies toast.tltl in each case."""
    signals = gentle_signals(ee=DOWN[None].copy(), rotation=np.zeros((1, 8, 3)))
    ee, rotation = signals["ee"][0], signals["rotation"][0]
    if change == "fast":
        ee[0, 2] += 0.03
    elif change == "from the side":
        ee[:4] = [[0.7, -0.35 + y, 0.085] for y in (0.16, 0.12, 0.08, 0.04)]
    elif change == "tilted in the slot":
        rotation[3:, 0] = 0.25
    elif change == "tilted against the gripper's place":
        ee[3:, 1], rotation[3:, 0] = -0.35 + 0.015, -0.15
    elif change == "tilted across":
        ee[3:, 0], rotation[3:, 1] = 0.7 - 0.015, 0.15
    elif change == "tilted above the table":
        ee[0] = [0.6, -0.62, -0.1]
        rotation[0, 1] = 0.2
    elif change == "tilted beside the slot":
        ee[:2] = [[0.7, -0.35 + y, 0.085] for y in (0.08, 0.04)]
        rotation[:2, 1] = 0.2
    own, gentle = load_spec(spec_path("toast")), load_spec(spec_path("toast_gentle"))
    assert own.robustness(signals)[0] > 0
    clauses = {name: values[0] for name, values in gentle.clauses(signals).items()}
    if decides:
        assert clauses[decides] == pytest.approx(value)
        assert clauses[decides] <= 0
    else:
        assert gentle.robustness(signals)[0] == pytest.approx(value)


def test_features_are_the_physics_own_quantities(physics: toast.Physics) -> None:
    task = make_task()
    rng = np.random.default_rng(1)
    qpos = rng.uniform(-1.5, 1.5, (40, 9)) * np.append(np.ones(7), [0.01, 0.01])
    qvel = rng.standard_normal((40, 9))
    features = task.features(qpos, qvel)
    for q, v, row in zip(qpos, qvel, features, strict=True):
        with physics.reset_context():
            physics.data.qpos[:], physics.data.qvel[:] = q, v
        np.testing.assert_allclose(
            row,
            np.concatenate(
                [
                    physics.joint_angles(),
                    physics.joint_velocities(),
                    physics.end_effector(),
                    physics.end_effector_rpy(),
                    [physics.gripper_position()],
                ]
            ),
            atol=1e-12,
        )


def test_signals_hold_the_pose() -> None:
    task = make_task()
    rng = np.random.default_rng(2)
    features = rng.uniform(-3, 3, (4, 5, 21))
    features[0, 0, 17:20] = [np.pi, 0, -np.pi]  # straight down, on the wrap
    signals = task.signals(features, np.zeros((4, 5, 8)))
    rotation = Rotation.from_matrix(toast.RELEASE_ROTATION.T) * Rotation.from_euler(
        "xyz", features[..., 17:20].reshape(-1, 3)
    )
    np.testing.assert_allclose(signals["rotation"].reshape(-1, 3), rotation.as_rotvec(), atol=1e-12)
    assert {name: value.shape for name, value in signals.items()} == {
        "ee": (4, 5, 3),
        "rotation": (4, 5, 3),
        "gripper": (4, 5),
        "velocities": (4, 5, 7),
        "command": (4, 5, 8),
    }


@pytest.mark.parametrize(("solid", "share"), [(False, 0.1), (False, 1.0), (True, 0.1)])
def test_batch_and_environment_give_the_same_trajectories(solid: bool, share: float) -> None:
    task = make_task(solid=solid, steps=40 if solid else 100)
    _, reference = task.reference()
    rng = np.random.default_rng(3)
    commands = reference + share * task.command_scale * rng.standard_normal((4, *reference.shape))
    commands[0, 10:, 1] = 1.5  # leans down to the table
    batch = Simulator(task).rollout(np.zeros((8, 21)), commands, np.zeros_like(commands))
    env = environment(task)
    for i, length in enumerate(batch.lengths):
        steps = [env.reset()]
        while not steps[-1].last():
            steps.append(env.step(commands[i, len(steps) - 1]))
        single = np.array([flat(step) for step in steps])
        assert len(single) == length
        np.testing.assert_allclose(unwrapped(single - batch.features[i, :length]), 0, atol=1e-9)
        assert steps[-1].discount == (0.0 if length < task.steps else 1.0)


def test_touching_the_table_ends_the_episode() -> None:
    task = make_task()
    commands = np.zeros((2, 100, 8))
    commands[1, 5:, 1] = 1.0
    given = commands.copy()
    batch = Simulator(task).rollout(np.zeros((8, 21)), commands, np.zeros_like(commands))
    np.testing.assert_array_equal(commands, given)
    assert batch.lengths[0] == 100
    end = batch.lengths[1] - 1
    height = batch.features[1, :, 16]
    assert 5 < end < 99
    assert height[end] < toast.TABLE_HEIGHT <= height[end - 1]
    np.testing.assert_array_equal(batch.features[1, end:], np.tile(batch.features[1, end], (100 - end, 1)))


def test_gravity_acts_and_is_compensated(physics: toast.Physics) -> None:
    task = make_task()
    np.testing.assert_array_equal(physics.model.opt.gravity, [0, 0, -9.81])
    rest = np.zeros((1, 100, 8))
    angles = Simulator(task).rollout(np.zeros((8, 21)), rest, rest).features[0, :, :7]
    np.testing.assert_allclose(angles, np.tile(angles[0], (100, 1)), atol=1e-6)


def test_timestep_is_short_enough() -> None:
    task = make_task()
    fine = task.make_physics()
    fine.model.opt.timestep = 0.0005
    rng = np.random.default_rng(4)
    commands = task.command_scale * 0.15 * rng.standard_normal((100, 8))
    commands[:, 7] = np.repeat([0, 100, 0, 100, 0], 20)
    paths = []
    for physics in (task.make_physics(), fine):
        with physics.reset_context():
            physics.data.qpos[:], physics.data.qvel[:] = task.initial_state()
        path = []
        for command in commands:
            physics.set_control(command)
            physics.step(round(0.05 / physics.timestep()))
            path.append([*physics.end_effector(), 1e-3 * physics.gripper_position()])  # 1 mm weighs as much as 1 %
        paths.append(path)
    np.testing.assert_allclose(paths[0], paths[1], atol=4e-3)


def test_gripper_closes_and_opens_within_one_sample() -> None:
    task = make_task()
    commands = np.zeros((1, 100, 8))
    commands[:, 10:20, 7] = 100
    gripper = Simulator(task).rollout(np.zeros((8, 21)), commands, np.zeros_like(commands)).features[0, :, 20]
    np.testing.assert_allclose(gripper[[0, 10]], 0, atol=0.1)
    np.testing.assert_allclose(gripper[[11, 20]], 100, atol=0.5)
    np.testing.assert_allclose(gripper[21], 0, atol=0.5)


def test_reference_starts_beside_the_toaster_and_ends_beside_the_slot() -> None:
    task = make_task()
    features, commands = task.reference()
    assert features.shape == (100, 21)
    assert commands.shape == (100, 8)
    positions = features[:, 14:17]
    np.testing.assert_allclose(positions[0], [0.60, -0.62, -0.10], atol=1e-3)
    np.testing.assert_allclose(positions[40], np.add(CONSTANTS["slot_centre"], [0, -0.03, 0.15]), atol=1e-3)
    beside_slot = np.add(CONSTANTS["slot_centre"], [0, -0.03, 0])
    np.testing.assert_allclose(positions[60:], np.tile(beside_slot, (40, 1)), atol=1e-3)
    assert np.all(np.abs(commands[:, :7]) <= task.command_scale[:7])
    assert set(commands[:, 7]) == {-20.0, 120.0}
    assert not task.terminated(features).any()


def test_the_closest_distance_so_far_remembers() -> None:
    distance = np.array([[0.1, 0.02, 0.1, 0.1], [0.02, 0.1, 0.1, 0.1], [0.1, 0.1, 0.1, 0.02]])
    expected = [[False, False, True, True, True], [False, True, True, True, True], [False] * 4 + [True]]
    np.testing.assert_array_equal(closest_before(distance, None) < 0.03, expected)


def test_comparison_reward_is_equation_3_9() -> None:
    reward = toast_rewards(replace(REWARD, c1=2.0, c2=0.5, c3=0.1), CONSTANTS)["continuous"]
    slot, toaster = np.array(CONSTANTS["slot_centre"]), np.array(CONSTANTS["toaster_centre"])
    above = slot + np.array([0, 0, 0.1])
    ee = np.array([above, slot, above])
    gripper = np.array([20.0, 20.0, 20.0])
    height = slot[2] - toaster[2]
    expected = [
        -2 * 0.1 + 0.5 * (height + 0.1) - 0.1 * 20,
        0.5 * height - 0.1 * 20,
        -2 * 0.1 + 0.5 * (height + 0.1) - 0.1 * 80,
    ]
    rewards, _ = reward({"ee": np.stack([ee, ee]), "gripper": np.stack([gripper] * 2)})
    np.testing.assert_allclose(rewards, [expected] * 2)


def test_environment_rewards_with_memory() -> None:
    task = make_task(steps=70)
    _, commands = task.reference()
    reward = toast_rewards(REWARD, CONSTANTS)["continuous"]
    env = environment(task, reward)
    env.reset()
    single = [env.step(command).reward for command in commands[:-1]]
    batch = Simulator(task).rollout(np.zeros((8, 21)), commands[None], np.zeros((1, 70, 8)))
    rewards, _ = reward(task.signals(batch.features, batch.commands))
    np.testing.assert_allclose(single, rewards[0, 1:], atol=1e-9)


def test_training_scene_collides_with_nothing(physics: toast.Physics) -> None:
    in_toaster = np.zeros(9)
    in_toaster[:7] = [1.1646, -0.4606, -0.7726, 1.4906, 0.8919, 0.8986, -0.7207]
    with physics.reset_context():
        physics.data.qpos[:] = in_toaster
    assert physics.data.ncon == 0
    assert "bread" not in physics.model.id2name(physics.model.nbody - 1, "body")


@pytest.mark.parametrize(
    ("waypoints", "opening_step", "placed"),
    [(INTO_SLOT, 58, True), (INTO_SLOT, 20, False), (INTO_SLOT, 1000, False), (None, 52, False)],
)
def test_bread_rests_in_the_slot_if_released_there(
    waypoints: list[list[float]] | None, opening_step: int, placed: bool
) -> None:
    waypoints = waypoints or TOAST.waypoints
    task = make_task(solid=True, waypoints=waypoints, opening_step=opening_step, steps=90)
    features, commands = task.reference()
    gain = -8 * task.feedback
    batch = Simulator(task).rollout(gain, (commands - features @ gain.T)[None], np.zeros((1, 90, 8)))
    assert task.bread_in_slot(batch.last_qpos, batch.last_qvel).tolist() == [placed]
    start = [state[None] for state in task.initial_state()]
    assert task.bread_in_slot(*start).tolist() == [False]


def test_bread_is_held_by_friction_until_released() -> None:
    task = make_task(solid=True, waypoints=INTO_SLOT, opening_step=1000, steps=60)
    features, commands = task.reference()
    gain = -8 * task.feedback
    batch = Simulator(task).rollout(gain, (commands - features @ gain.T)[None], np.zeros((1, 60, 8)))
    foot, hand = batch.last_qpos[0, 9:12], batch.features[0, -1, 14:17]
    np.testing.assert_allclose(foot, hand - [0, 0, toast.BREAD_REACH], atol=0.006)
    assert batch.features[0, 5:, 20].max() < 30  # closed, by the spec's delta_close, around a thick slice


def test_both_scenes_move_the_arm_alike() -> None:
    paths = []
    for solid in (False, True):
        task = make_task(solid=solid, steps=50)
        features, commands = task.reference()
        gain = -8 * task.feedback
        batch = Simulator(task).rollout(gain, (commands - features @ gain.T)[None], np.zeros((1, 50, 8)))
        paths.append(batch.features[0, :, 14:17])
    np.testing.assert_allclose(paths[0], paths[1], atol=5e-3)


def test_wrong_waypoints_are_told() -> None:
    with pytest.raises(UserError, match="waypoint_steps"):
        make_task(waypoint_steps=[0, 60, 40])
    with pytest.raises(UserError, match="waypoint_steps"):
        make_task(waypoint_steps=[0, 40])
    with pytest.raises(UserError, match="joint angles"):
        make_task(waypoints=[[0.0] * 6] * 3)
    with pytest.raises(UserError, match="slot_centre"):
        toast_rewards(REWARD, {})


@pytest.mark.parametrize("opening_step", [52, 58, 1000])
def test_rough_motion_violates_the_spec(opening_step: int) -> None:
    task = make_task(opening_step=opening_step)
    features, commands = task.reference()
    gain = -8 * task.feedback
    batch = Simulator(task).rollout(gain, (commands - features @ gain.T)[None], np.zeros((1, 100, 8)))
    spec = load_spec(spec_path("toast.tltl"))
    robustness = spec.robustness(task.signals(batch.features, batch.commands), batch.lengths)
    assert -0.06 < robustness[0] < -0.001


def test_a_gripper_that_reaches_the_slot_with_the_last_sample_and_stays_closed_satisfies_the_printed_formula_alone():
    """The X of a last sample asks for nothing; the shipped spec asks for the release."""
    steps = 6
    ee = np.linspace((0.7, -0.35, 0.3), (0.7, -0.35, 0.05), steps)
    signals = {"ee": ee[None], "rotation": np.zeros((1, steps, 3)), "gripper": np.zeros((1, steps))}
    printed, meant = (load_spec(spec_path(f"{name}.tltl")).robustness(signals)[0] for name in ("toast_eq37", "toast"))
    assert printed == pytest.approx(0.025)
    assert meant == pytest.approx(-70 * 0.025 / 30)  # how far a closed gripper, at 0, is from one opened to 70
    signals["gripper"][:, -1] = 100.0
    signals["ee"][:, -2] = signals["ee"][:, -1]
    assert load_spec(spec_path("toast.tltl")).robustness(signals)[0] > 0
