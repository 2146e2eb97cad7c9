"""Planar arm domain: three links, joint-velocity commands, goals and obstacles that are regions and not bodies.

Both simulated 2D manipulation tasks of the case study (section 3.3.3) are this arm; they differ in their spec, in
their length and in their hand-made rewards (eqs 3.2 and 3.5; rewards.py).

| index | feature | unit |
|---|---|---|
| 0 | angle_1 | rad |
| 1 | angle_2 | rad |
| 2 | angle_3 | rad |
| 3 | velocity_1 | rad/s |
| 4 | velocity_2 | rad/s |
| 5 | velocity_3 | rad/s |
| 6 | end_effector_x | m |
| 7 | end_effector_y | m |
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from types import MappingProxyType
from typing import ClassVar

import dm_control.mujoco
import mujoco
import numpy as np
from dm_control.mujoco.wrapper import MjModel

from tltlrl.errors import UserError
from tltlrl.settings import check, setting
from tltlrl.tasks.task import MOST_STEPS, Array, Joints, Quantity, Signals, Task

JOINTS = ("joint_1", "joint_2", "joint_3")
HEADING = np.triu(np.ones((3, 3)))  # angles @ HEADING: each link's angle from the x axis, a sum up to its own angle


@dataclass(frozen=True)
class PlanarArmConfig:
    """The arm and its episode: the settings of reach_avoid.

    Attributes:
      edition: raised when the same settings simulate other motions, so that old results are not taken for new ones.
        Edition 1 had two physics steps of 25 ms per control step.
    """

    edition: ClassVar[int] = 2
    name: str = setting("name of the task", "reach_avoid")
    steps: int = setting("samples of one episode", 200, least=2, most=MOST_STEPS)
    link_lengths: list[float] = setting("lengths of the links from the base outwards, m", [1.0, 1.0, 1.0], above=0)
    start_angles: list[float] = setting("joint angles at the start, rad", [0.5, 0.5, 0.5])
    max_speed: float = setting("bound of every joint-velocity command, rad/s", 2.0, above=0)
    command_noise: float = setting("standard deviation of the actuators' noise, rad/s", 0.02, least=0)

    def __post_init__(self) -> None:
        if len(self.link_lengths) != 3:
            raise UserError(f"task.link_lengths: {self.link_lengths} must be three positive lengths, m")
        if len(self.start_angles) != 3:
            raise UserError(f"task.start_angles: {self.start_angles} must be three angles, rad")
        check(self, "task")


@dataclass(frozen=True)
class VisitInOrderConfig(PlanarArmConfig):
    """The settings of visit_in_order."""

    name: str = setting("name of the task", "visit_in_order")
    steps: int = setting("samples of one episode", 500, least=2, most=MOST_STEPS)


class Physics(dm_control.mujoco.Physics):  # type: ignore[misc]  # dm_control has no types
    """Simulation of the arm."""

    def end_effector(self) -> Array:
        """Position (2,) of the end of the last link, m."""
        return np.array(self.named.data.site_xpos["end_effector", ["x", "y"]])


class PlanarArm(Task):
    """The arm as a task; rewards and the spec make it reach_avoid or visit_in_order."""

    control_timestep = 0.05  # s: commands are sent at 20 Hz, as in the case study
    observation = (
        Quantity("angles", "rad", ("angle_1", "angle_2", "angle_3")),
        Quantity("velocities", "rad/s", ("velocity_1", "velocity_2", "velocity_3")),
        Quantity("end_effector", "m", ("end_effector_x", "end_effector_y")),
    )
    action = (Quantity("speeds", "rad/s", ("speed_1", "speed_2", "speed_3")),)
    units: Mapping[str, str] = MappingProxyType({"ee": "m", "angles": "rad", "velocities": "rad/s", "command": "rad/s"})
    camera = "above"
    joints = Joints()
    end_effector = "end_effector"

    def __init__(self, config: PlanarArmConfig) -> None:
        self.name = config.name
        self.steps = config.steps
        self.command_noise = np.full(3, config.command_noise)
        self.command_scale = np.full(3, config.max_speed)
        self.feedback = np.eye(3, self.width)  # on the joint angles
        self.config = config
        self._link_lengths = np.array(config.link_lengths)
        self.skeleton = self.joint_positions

    def make_physics(self) -> Physics:
        """Compiles arm.xml with the configured link lengths and speed limit."""
        return Physics.from_model(MjModel(arm_model(self.config.link_lengths, self.config.max_speed)))

    def initial_state(self) -> tuple[Array, Array]:
        """The configured start angles, at rest."""
        return np.array(self.config.start_angles), np.zeros(3)

    def features(self, qpos: Array, qvel: Array) -> Array:
        """Angles, velocities and the end-effector's position by the arm's forward kinematics."""
        features = np.empty((len(qpos), self.width))
        features[:, self.slices["angles"]], features[:, self.slices["velocities"]] = qpos, qvel
        features[:, self.slices["end_effector"]] = forward_kinematics(qpos, self._link_lengths)
        return features

    def signals(self, features: Array, commands: Array) -> Signals:
        """`ee` (m), `angles` (rad), `velocities` (rad/s) and `command` (rad/s, as the policy sent it)."""
        return {
            "ee": features[..., self.slices["end_effector"]],
            "angles": features[..., self.slices["angles"]],
            "velocities": features[..., self.slices["velocities"]],
            "command": commands,
        }

    def reference(self) -> tuple[Array, Array]:
        """Rest at the start."""
        qpos, qvel = self.initial_state()
        start = self.features(qpos[None], qvel[None])
        return np.tile(start, (self.steps, 1)), np.zeros((self.steps, 3))

    def joint_positions(self, features: Array) -> Array:
        """Base, both inner joints and the end-effector: features (..., n) => (..., 4, 2), m."""
        return joint_positions(features[..., self.slices["angles"]], self._link_lengths)


def forward_kinematics(angles: Array, link_lengths: Array) -> Array:
    """End of the last link: (..., 3) joint angles in rad, (3,) lengths in m => (..., 2) in m."""
    heading = angles @ HEADING
    position = np.empty((*angles.shape[:-1], 2))
    position[..., 0], position[..., 1] = np.cos(heading) @ link_lengths, np.sin(heading) @ link_lengths
    return position


def joint_positions(angles: Array, link_lengths: Array) -> Array:
    """Base, both inner joints and the end-effector: (..., 3) rad, (3,) m => (..., 4, 2) m."""
    heading = angles @ HEADING
    links = np.stack([np.cos(heading), np.sin(heading)], axis=-1) * link_lengths[:, None]
    return np.concatenate([np.zeros_like(links[..., :1, :]), np.cumsum(links, axis=-2)], axis=-2)


def arm_model(link_lengths: Sequence[float], max_speed: float) -> mujoco.MjModel:
    """arm.xml with the given link lengths (m) and command limit (rad/s)."""
    arm = mujoco.MjSpec.from_string(files("tltlrl.tasks.planar_arm").joinpath("arm.xml").read_text(encoding="utf-8"))
    ends = (arm.body("link_2"), arm.body("link_3"), arm.site("end_effector"))
    for i, (length, end) in enumerate(zip(link_lengths, ends, strict=True), start=1):
        arm.geom(f"link_{i}").fromto = [0, 0, 0, length, 0, 0]
        end.pos = [length, 0, 0]
    for servo in arm.actuators:
        servo.ctrlrange = [-max_speed, max_speed]
    return arm.compile()
