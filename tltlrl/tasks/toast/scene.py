"""Toast domain: Baxter's right arm places a slice of bread in a toaster (case study, section 3.3.3, eqs 3.7 to 3.9).

An episode has 100 samples at 20 Hz, that is 5 s; the case study says "around 6 seconds" of the same 100 samples.

| index | feature | unit |
|---|---|---|
| 0 | angle_s0 | rad |
| 1 | angle_s1 | rad |
| 2 | angle_e0 | rad |
| 3 | angle_e1 | rad |
| 4 | angle_w0 | rad |
| 5 | angle_w1 | rad |
| 6 | angle_w2 | rad |
| 7 | velocity_s0 | rad/s |
| 8 | velocity_s1 | rad/s |
| 9 | velocity_e0 | rad/s |
| 10 | velocity_e1 | rad/s |
| 11 | velocity_w0 | rad/s |
| 12 | velocity_w1 | rad/s |
| 13 | velocity_w2 | rad/s |
| 14 | end_effector_x | m |
| 15 | end_effector_y | m |
| 16 | end_effector_z | m |
| 17 | end_effector_roll | rad |
| 18 | end_effector_pitch | rad |
| 19 | end_effector_yaw | rad |
| 20 | gripper | % |

The end-effector is the point between the fingertips, 0.12 m beyond `right_hand`, in Baxter's base frame (x forward, y
left, z up). Roll, pitch and yaw turn about fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll). A gripper that points straight
down sits where roll and yaw wrap from pi to -pi; the signal `rotation` does not wrap there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from importlib.resources import files
from types import MappingProxyType

import dm_control.mujoco
import mujoco
import numpy as np
from dm_control.mujoco.wrapper import MjModel
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tltlrl.errors import UserError
from tltlrl.settings import check, setting
from tltlrl.tasks.task import MOST_STEPS, Array, Joints, Quantity, Signals, Task

# Kinematics of the right arm: Rethink Robotics' description (baxter_common 1.2.0). Each row is the child frame's
# origin (m) and fixed-axis roll, pitch, yaw (rad) in its parent's frame; the joint then turns about the child's z axis.
MOUNT = ((0.024645, -0.219645, 0.118588), (0.0, 0.0, -0.7854))  # right_arm_mount in the base frame
HALF_TURN = np.pi / 2
LINKS = {
    "s0": ((0.055695, 0.0, 0.011038), (0.0, 0.0, 0.0)),
    "s1": ((0.069, 0.0, 0.27035), (-HALF_TURN, 0.0, 0.0)),
    "e0": ((0.102, 0.0, 0.0), (HALF_TURN, 0.0, HALF_TURN)),
    "e1": ((0.069, 0.0, 0.26242), (-HALF_TURN, -HALF_TURN, 0.0)),
    "w0": ((0.10359, 0.0, 0.0), (HALF_TURN, 0.0, HALF_TURN)),
    "w1": ((0.01, 0.0, 0.2707), (-HALF_TURN, -HALF_TURN, 0.0)),
    "w2": ((0.115975, 0.0, 0.0), (HALF_TURN, 0.0, HALF_TURN)),
}
HAND = ((0.0, 0.0, 0.11355), (0.0, 0.0, 0.0))  # right_hand in the last link's frame
ENDPOINT = ((0.0, 0.0, 0.12), (0.0, 0.0, 0.0))  # between the fingertips, in the frame of right_hand

JOINTS = tuple(f"right_{name}" for name in LINKS)
FINGERS = ("right_left_finger", "right_right_finger")
FINGER_TRAVEL = 0.020833  # m, of each finger from closed to open
SPEED_LIMITS = np.array([1.5, 1.5, 1.5, 1.5, 4.0, 4.0, 4.0])  # rad/s
GRIPPER_RANGE = 100.0  # commands and positions of the gripper run from 0 (closed) to 100 (open)

TABLE_HEIGHT = -0.20  # m, z of the table's top
RELEASE_ROTATION = np.diag([-1.0, 1.0, -1.0])  # gripper straight down, its fingers closing along y

# Evaluation scene.
SOLID_TIMESTEP = 0.001  # s; contacts of a 35 g slice between stiff fingers need a finer step than the free arm
BREAD_HALF_THICKNESS = 0.012  # m
FINGER_GAP = 0.008  # m, from the middle to each pad of the closed gripper
BREAD_REACH = 0.09  # m, from the end-effector down to the foot of the slice it holds
SLOT_DEPTH = 0.105  # m, from the toaster's top to the floor of the slot
SLOT_HALF_SIZE = np.array([0.08, 0.03])  # m, x and y
RESTING_HEIGHT = 0.02  # m, of the slice's foot above the slot's floor, at most
RESTING_SPEED = 0.01  # m/s, of the slice, at most


ROUGH_MOTION = [  # s0, s1, e0, e1, w0, w1, w2, rad
    [0.6596, -0.3849, -0.7403, 1.4209, 0.9226, 0.9014, -1.1426],  # beside the toaster: (0.60, -0.62, -0.10) m
    [1.2158, -0.8042, -1.0417, 1.3851, 0.6594, 1.3581, -0.6208],  # above the toaster: (0.70, -0.38, 0.20) m
    [1.1548, -0.6221, -0.9009, 1.4833, 0.7952, 1.1021, -0.6967],  # 3 cm beside the slot's centre: (0.70, -0.38, 0.05) m
]


@dataclass(frozen=True)
class ToastConfig:
    """The episode, and the rough hand-made motion that learning starts from.

    The reference motion is a polyline in joint space through `waypoints` at `waypoint_steps`. It stays at the last
    waypoint. The gripper opens at `opening_step`. In training nothing collides. `solid` is the evaluation scene: the
    toaster is solid, and the gripper holds the bread, a body, by friction.
    """

    name: str = setting("name of the task", "toast")
    steps: int = setting("samples of one episode; 100 at 20 Hz are 5 s", 100, least=2, most=MOST_STEPS)
    waypoints: list[list[float]] = setting(
        "waypoints of the rough motion that learning starts from: s0 s1 e0 e1 w0 w1 w2, rad", ROUGH_MOTION
    )
    waypoint_steps: list[int] = setting("sample at which each waypoint is passed; the first is 0", [0, 40, 60])
    opening_step: int = setting("step at which the rough motion opens the gripper; 52 is 0.4 s too early", 52)
    grip: float = setting(
        "per cent beyond closed and open that the rough motion commands, so that noise loosens no grip", 20.0
    )
    command_noise: float = setting(
        "standard deviation of the actuators' noise, as a share of a full command", 0.005, least=0
    )
    solid: bool = setting("true: the toaster is solid and the bread a body, as in the evaluation trials", False)

    def __post_init__(self) -> None:
        check(self, "task")
        if any(len(waypoint) != len(JOINTS) for waypoint in self.waypoints):
            raise UserError(f"task.waypoints: each needs the {len(JOINTS)} joint angles {', '.join(LINKS)}")
        steps = self.waypoint_steps
        if len(steps) != len(self.waypoints) or not steps or steps[0] != 0 or np.any(np.diff(steps) <= 0):
            raise UserError(
                f"task.waypoint_steps: {steps} must be {len(self.waypoints)} rising steps, one per waypoint, from 0"
            )


class Physics(dm_control.mujoco.Physics):  # type: ignore[misc]  # dm_control has no types
    """Simulation of arm, gripper, toaster and, in the evaluation scene, bread, with their quantities by name."""

    def joint_angles(self) -> Array:
        """Joint angles (7,) from shoulder to wrist, rad."""
        return np.array(self.named.data.qpos[list(JOINTS)])

    def joint_velocities(self) -> Array:
        """Joint velocities (7,), rad/s."""
        return np.array(self.named.data.qvel[list(JOINTS)])

    def end_effector(self) -> Array:
        """Position (3,) of the point between the fingertips, m, in the base frame."""
        return np.array(self.named.data.site_xpos["endpoint"])

    def end_effector_rpy(self) -> Array:
        """Roll, pitch and yaw (3,) of the gripper in the base frame, rad."""
        return roll_pitch_yaw(self.named.data.site_xmat["endpoint"].reshape(3, 3))

    def gripper_position(self) -> float:
        """How far the gripper is open, 0 to 100."""
        left, right = self.named.data.qpos[list(FINGERS)]
        return float(gripper_position(left, right))

    def bread_in_slot(self) -> bool:
        """Whether the slice rests in the slot: its foot between the walls and near the floor, and not moving.

        Raises:
          KeyError: in the training scene, which has no bread.
        """
        foot = self.named.data.xpos["bread"] - self.named.data.site_xpos["slot"]
        within = bool(np.all(np.abs(foot[:2]) < SLOT_HALF_SIZE))
        low = bool(foot[2] < RESTING_HEIGHT - SLOT_DEPTH)
        speed = float(np.linalg.norm(self.named.data.qvel["bread"][:3]))
        return within and low and speed < RESTING_SPEED


class Toast(Task):
    """The toast-placing task."""

    control_timestep = 0.05  # s: commands are sent at 20 Hz
    units: Mapping[str, str] = MappingProxyType(
        {"ee": "m", "rotation": "rad", "gripper": "%", "velocities": "rad/s", "command": "rad/s, %"}
    )
    camera = "front"
    joints = Joints()
    end_effector = "end_effector"
    observation = (
        Quantity("angles", "rad", tuple(f"angle_{joint}" for joint in LINKS)),
        Quantity("velocities", "rad/s", tuple(f"velocity_{joint}" for joint in LINKS)),
        Quantity("end_effector", "m", tuple(f"end_effector_{axis}" for axis in "xyz")),
        Quantity("end_effector_rpy", "rad", ("end_effector_roll", "end_effector_pitch", "end_effector_yaw")),
        Quantity("gripper", "%", ("gripper",)),
    )
    action = (
        Quantity("speeds", "rad/s", tuple(f"speed_{joint}" for joint in LINKS)),
        Quantity("gripper", "%", ("gripper",)),
    )

    def __init__(self, config: ToastConfig) -> None:
        self.name = config.name
        self.steps = config.steps
        self.command_scale = np.append(SPEED_LIMITS, GRIPPER_RANGE)
        self.command_noise = config.command_noise * self.command_scale
        self.feedback = np.eye(8, self.width) * np.append(np.ones(7), 0.0)[:, None]  # on the angles
        self.config = config

    def make_physics(self) -> Physics:
        """Compiles toast.xml: for training without bread and contacts, for evaluation (`solid`) with both."""
        return Physics.from_model(MjModel(scene_model(self.config.solid)))

    def initial_state(self) -> tuple[Array, Array]:
        """The first waypoint at rest, the gripper closed; in the evaluation scene around the slice."""
        angles = np.array(self.config.waypoints[0])
        if not self.config.solid:
            return np.concatenate([angles, np.zeros(2)]), np.zeros(9)
        squeezed = BREAD_HALF_THICKNESS - FINGER_GAP
        position, rotation = forward_kinematics(angles)
        foot = position + rotation @ np.array([0.0, 0.0, BREAD_REACH])
        upright = Rotation.from_matrix(rotation @ np.diag([1.0, -1.0, -1.0])).as_quat(scalar_first=True)
        return np.concatenate([angles, [squeezed, -squeezed], foot, upright]), np.zeros(15)

    def features(self, qpos: Array, qvel: Array) -> Array:
        """The 21 features; the end-effector's pose by the arm's forward kinematics."""
        position, rotation = forward_kinematics(qpos[..., :7])
        gripper = gripper_position(qpos[..., 7:8], qpos[..., 8:9])
        return np.concatenate([qpos[..., :7], qvel[..., :7], position, roll_pitch_yaw(rotation), gripper], axis=-1)

    def signals(self, features: Array, commands: Array) -> Signals:
        """The signals of eq. 3.7.

        `ee` (N, T, 3): end-effector in the base frame, m. `rotation` (N, T, 3): rotation vector from the release
        orientation to the gripper's, rad, in the gripper's axes. `gripper` (N, T): 0 closed to 100 open. `velocities`
        (N, T, 7): rad/s. `command` (N, T, 8): as the policy sent it and before it is clipped, rad/s and %.
        """
        return {
            "ee": features[..., self.slices["end_effector"]],
            "rotation": rotation_from_release(features[..., self.slices["end_effector_rpy"]]),
            "gripper": features[..., self.slices["gripper"]][..., 0],
            "velocities": features[..., self.slices["velocities"]],
            "command": commands,
        }

    def reference(self) -> tuple[Array, Array]:
        """The hand-made motion of the configuration."""
        config = self.config
        samples = np.arange(self.steps)
        angles = np.stack(
            [np.interp(samples, config.waypoint_steps, path) for path in np.transpose(config.waypoints)],
            axis=-1,
        )
        speeds = np.diff(angles, axis=0, append=angles[-1:]) / self.control_timestep
        opened = samples >= config.opening_step
        gripper = np.where(opened, GRIPPER_RANGE + config.grip, -config.grip)
        fingers = np.outer(opened, [FINGER_TRAVEL, -FINGER_TRAVEL])
        features = self.features(np.concatenate([angles, fingers], axis=-1), speeds)
        return features, np.column_stack([speeds, gripper])

    def outcomes(self, last_qpos: Array, last_qvel: Array) -> dict[str, NDArray[np.bool_]]:
        """Whether the bread rests in the slot, where there is bread."""
        return {"bread_in_slot": self.bread_in_slot(last_qpos, last_qvel)} if self.config.solid else {}

    def bread_in_slot(self, qpos: Array, qvel: Array) -> NDArray[np.bool_]:
        """Whether the slice rests in the slot in each state of the evaluation scene: (N, nq), (N, nv) => (N,)."""
        physics = self.make_physics()
        rests = np.empty(len(qpos), dtype=np.bool_)
        for i in range(len(qpos)):
            with physics.reset_context():
                physics.data.qpos[:], physics.data.qvel[:] = qpos[i], qvel[i]
            rests[i] = physics.bread_in_slot()
        return rests

    def terminated(self, features: Array) -> NDArray[np.bool_]:
        """Touching the table ends an episode, judged by the end-effector's height alone."""
        height = features[..., self.slices["end_effector"]][..., 2]
        return np.asarray(height < TABLE_HEIGHT)


def forward_kinematics(angles: Array) -> tuple[Array, Array]:
    """End-effector in the base frame: joint angles (..., 7) in rad => position (..., 3) in m, rotation (..., 3, 3)."""
    turns = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=-1)[..., None, :]
    links = [(turns[..., i, :, :] @ TRANSFORMS[i]).reshape(*angles.shape[:-1], 4, 4) for i in range(7)]
    pose = reduce(np.matmul, links)
    return pose[..., :3, 3], pose[..., :3, :3]


def roll_pitch_yaw(rotation: Array) -> Array:
    """Angles (..., 3) about the fixed x, y, z axes, rad, of rotation matrices (..., 3, 3)."""
    r = rotation
    roll = np.arctan2(r[..., 2, 1], r[..., 2, 2])
    pitch = np.arctan2(-r[..., 2, 0], np.hypot(r[..., 0, 0], r[..., 1, 0]))
    yaw = np.arctan2(r[..., 1, 0], r[..., 0, 0])
    return np.stack([roll, pitch, yaw], axis=-1)


def rotation_from_release(rpy: Array) -> Array:
    """Rotation vector of R*^T R with R* the release orientation: angles (..., 3) => (..., 3), rad."""
    roll, pitch, yaw = np.moveaxis(rpy / 2, -1, 0)
    cr, cp, cy, sr, sp, sy = (
        np.cos(roll),
        np.cos(pitch),
        np.cos(yaw),
        np.sin(roll),
        np.sin(pitch),
        np.sin(yaw),
    )
    # The quaternion of Rz Ry Rx; R* is half a turn about y, and R*^T takes (w, x, y, z) to (y, -z, -w, x).
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    scalar, vector = y, np.stack([-z, -w, x], axis=-1)
    half_sine = np.linalg.norm(vector, axis=-1)
    angle = 2 * np.arctan2(half_sine, np.abs(scalar))  # a quaternion and its negative are one rotation
    signed = np.copysign(angle, scalar) / np.maximum(half_sine, np.finfo(float).tiny)
    return np.asarray(signed[..., None] * vector)


def gripper_position(left: Array, right: Array) -> Array:
    """Opening 0..100 from the positions of both fingers, m, of any one shape."""
    return np.asarray(GRIPPER_RANGE * (left - right) / (2 * FINGER_TRAVEL))


def scene_model(solid: bool) -> mujoco.MjModel:
    """toast.xml, the evaluation scene; unless `solid` without the bread and without contacts, for training."""
    scene = mujoco.MjSpec.from_string(files("tltlrl.tasks.toast").joinpath("toast.xml").read_text(encoding="utf-8"))
    if solid:
        scene.option.timestep = SOLID_TIMESTEP
    else:
        scene.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        scene.delete(scene.body("bread"))
    return scene.compile()


def _frame(origin: tuple[float, float, float], rpy: tuple[float, float, float]) -> Array:
    """Homogeneous transform (4, 4) of a frame in its parent's."""
    frame = np.eye(4)
    frame[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    frame[:3, 3] = origin
    return frame


def _link_transforms() -> Array:
    """Constants A, B, C of T_i(q) = A_i + B_i cos q + C_i sin q, flattened: (7, 3, 16).

    T_i leads from link i to its parent; the first includes the mount, the last the hand and the end-effector.
    """
    before = [_frame(*link) for link in LINKS.values()]
    before[0] = _frame(*MOUNT) @ before[0]
    after = [np.eye(4)] * 6 + [_frame(*HAND) @ _frame(*ENDPOINT)]
    constant = np.diag([0.0, 0.0, 1.0, 1.0])
    cosine = np.diag([1.0, 1.0, 0.0, 0.0])
    sine = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]])
    return np.array(
        [[(b @ turn @ a).ravel() for turn in (constant, cosine, sine)] for b, a in zip(before, after, strict=True)]
    )


TRANSFORMS = _link_transforms()
