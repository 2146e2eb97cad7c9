"""Planar arm domain: three links, joint-velocity commands, goals and obstacles that are regions and not bodies.

Both simulated 2D manipulation tasks of the case study (section 3.3.3) are this arm; they differ in their spec, in
their length and in their hand-made rewards (eqs 3.2 and 3.5).

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

import collections
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import numpy as np
from dm_control import mujoco
from lxml import etree

from tltlrl.errors import UserError
from tltlrl.tasks.task import Array, Quantity, Signals, StepReward, Task

JOINTS = ("joint_1", "joint_2", "joint_3")


@dataclass(frozen=True)
class PlanarArmConfig:
    """The arm and its episode.

    Attributes:
      name: reach_avoid or visit_in_order.
      steps: samples of one episode.
      link_lengths: metres, from the base outwards.
      start_angles: joint angles at s_0, rad.
      max_speed: bound of every joint-velocity command, rad/s.
      command_noise: standard deviation of the noise on every command, rad/s.
    """

    name: str = "reach_avoid"
    steps: int = 200
    link_lengths: list[float] = field(default_factory=lambda: [1.0, 1.0, 1.0])
    start_angles: list[float] = field(default_factory=lambda: [0.5, 0.5, 0.5])
    max_speed: float = 2.0
    command_noise: float = 0.02


@dataclass(frozen=True)
class ReachAvoidReward:
    """Coefficients of eq. 3.2.

    Attributes:
      goal: discrete reward of a sample at the goal.
      obstacle: discrete reward of a sample inside an obstacle.
      c1: price of a metre from the goal.
      c2: gain of a metre from each obstacle.
    """

    goal: float = 5.0
    obstacle: float = -2.0
    c1: float = 1.0
    c2: float = 0.1


class Physics(mujoco.Physics):  # type: ignore[misc]  # dm_control has no types
    """Simulation of the arm with its quantities by name."""

    def joint_angles(self) -> Array:
        """Joint angles (3,), rad; each link's relative to the one before."""
        return np.array(self.named.data.qpos[list(JOINTS)])

    def joint_velocities(self) -> Array:
        """Joint velocities (3,), rad/s."""
        return np.array(self.named.data.qvel[list(JOINTS)])

    def end_effector(self) -> Array:
        """Position (2,) of the end of the last link, m."""
        return np.array(self.named.data.site_xpos["end_effector", ["x", "y"]])


class PlanarArm(Task):
    """The arm as a task; `rewards` and the spec make it reach_avoid or visit_in_order."""

    observation = (
        *(Quantity(f"angle_{i}", "rad") for i in (1, 2, 3)),
        *(Quantity(f"velocity_{i}", "rad/s") for i in (1, 2, 3)),
        Quantity("end_effector_x", "m"),
        Quantity("end_effector_y", "m"),
    )
    action = tuple(Quantity(f"speed_{i}", "rad/s") for i in (1, 2, 3))

    def __init__(
        self,
        config: PlanarArmConfig,
        rewards: Mapping[str, StepReward],
        random: np.random.RandomState | int | None = None,
    ) -> None:
        super().__init__(
            steps=config.steps,
            command_noise=np.full(3, config.command_noise),
            command_scale=np.full(3, config.max_speed),
            feedback=np.eye(3, len(self.observation)),  # on the joint angles
            rewards=rewards,
            random=random,
        )
        self.name = config.name
        self.config = config
        self._link_lengths = np.array(config.link_lengths)

    def make_physics(self) -> Physics:
        """Compiles planar_arm.xml with the configured link lengths and speed limit."""
        return Physics.from_xml_string(model_xml(self.config.link_lengths, self.config.max_speed))

    def initial_state(self) -> tuple[Array, Array]:
        """The configured start angles, at rest."""
        return np.array(self.config.start_angles), np.zeros(3)

    def features(self, qpos: Array, qvel: Array) -> Array:
        """Angles, velocities and the end-effector's position by the arm's forward kinematics."""
        return np.concatenate([qpos, qvel, forward_kinematics(qpos, self._link_lengths)], axis=-1)

    def signals(self, features: Array, commands: Array) -> Signals:
        """`ee` (m), `angles` (rad), `velocities` (rad/s) and `command` (rad/s, as the policy sent it)."""
        return {
            "ee": features[..., 6:8],
            "angles": features[..., 0:3],
            "velocities": features[..., 3:6],
            "command": commands,
        }

    def reference(self) -> tuple[Array, Array]:
        """Rest at the start."""
        qpos, qvel = self.initial_state()
        start = self.features(qpos[None], qvel[None])
        return np.tile(start, (self.steps, 1)), np.zeros((self.steps, 3))

    def observe(self, physics: Physics) -> collections.OrderedDict[str, Array]:
        """The eight features in three groups."""
        return collections.OrderedDict(
            angles=physics.joint_angles(),
            velocities=physics.joint_velocities(),
            end_effector=physics.end_effector(),
        )


def reach_avoid_rewards(coefficients: ReachAvoidReward, constants: Mapping[str, Any]) -> dict[str, StepReward]:
    """The discrete and the continuous reward of eq. 3.2, on the regions of the spec.

    Args:
      coefficients: of eq. 3.2.
      constants: the spec's: goal (x, y), goal_radius, obstacle and obstacle_radius (families of two), m.
    """
    goal, goal_radius, obstacles, radii = _regions(constants)

    def discrete(signals: Mapping[str, Array]) -> Array:
        at_goal = _distance(signals["ee"], goal) <= goal_radius
        inside = np.any([_distance(signals["ee"], o) <= r for o, r in zip(obstacles, radii, strict=True)], axis=0)
        return np.select([at_goal, inside], [coefficients.goal, coefficients.obstacle], 0.0)

    def continuous(signals: Mapping[str, Array]) -> Array:
        from_obstacles = sum(_distance(signals["ee"], o) for o in obstacles)
        return np.asarray(-coefficients.c1 * _distance(signals["ee"], goal) + coefficients.c2 * from_obstacles)

    return {"discrete": discrete, "continuous": continuous}


def _regions(constants: Mapping[str, Any]) -> tuple[Array, float, list[Array], list[float]]:
    """Goal, its radius, obstacles and their radii, by the names that the hand-made rewards rely on."""
    try:
        obstacles = constants["obstacle"]
        radii = [float(constants["obstacle_radius"][i]) for i in obstacles]
        goal, goal_radius = np.array(constants["goal"], dtype=float), float(constants["goal_radius"])
    except (KeyError, TypeError) as error:
        raise UserError(
            f"the hand-made rewards of reach_avoid need the spec's constants goal, goal_radius, obstacle[...] and "
            f"obstacle_radius[...]; this spec has: {', '.join(constants) or 'none'} ({error}). Define them, or train "
            f"on the spec alone: cases=[tltl_episodic]"
        ) from error
    return goal, goal_radius, [np.array(o, dtype=float) for o in obstacles.values()], radii


def _distance(points: Array, centre: Array) -> Array:
    """Euclidean distance, (..., 2) => (...)."""
    return np.asarray(np.sqrt(np.sum((points - centre) ** 2, axis=-1)))


def forward_kinematics(angles: Array, link_lengths: Array) -> Array:
    """End of the last link: (..., 3) joint angles in rad, (3,) lengths in m => (..., 2) in m."""
    heading = np.cumsum(angles, axis=-1)
    return np.stack([np.cos(heading) @ link_lengths, np.sin(heading) @ link_lengths], axis=-1)


def model_xml(link_lengths: Sequence[float], max_speed: float) -> str:
    """planar_arm.xml with the given link lengths (m) and command limit (rad/s)."""
    root = etree.fromstring(files("tltlrl.tasks").joinpath("planar_arm.xml").read_bytes())
    ends = ("./worldbody//body[@name='link_2']", "./worldbody//body[@name='link_3']", ".//site")
    for i, (length, end) in enumerate(zip(link_lengths, ends, strict=True), start=1):
        root.find(f".//geom[@name='link_{i}']").set("fromto", f"0 0 0 {length!r} 0 0")
        root.find(end).set("pos", f"{length!r} 0 0")
    root.find("./default/velocity").set("ctrlrange", f"{-max_speed!r} {max_speed!r}")
    return str(etree.tostring(root, encoding="unicode"))
