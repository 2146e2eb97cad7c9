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
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from dm_control import mujoco
from lxml import etree
from numpy.typing import NDArray

from tltlrl.errors import UserError
from tltlrl.tasks.task import Array, Quantity, Signals, StepReward, Task, required_constants

JOINTS = ("joint_1", "joint_2", "joint_3")
HEADING = np.triu(np.ones((3, 3)))  # angles @ HEADING: each link's angle from the x axis, the sum of those before it


@dataclass(frozen=True)
class PlanarArmConfig:
    """The arm and its episode; the defaults are in configs/task.

    Attributes:
      name: reach_avoid or visit_in_order.
      steps: samples of one episode.
      link_lengths: metres, from the base outwards.
      start_angles: joint angles at s_0, rad.
      max_speed: bound of every joint-velocity command, rad/s.
      command_noise: standard deviation of the noise on every command, rad/s.
    """

    name: str
    steps: int
    link_lengths: list[float]
    start_angles: list[float]
    max_speed: float
    command_noise: float

    def __post_init__(self) -> None:
        if len(self.link_lengths) != 3 or min(self.link_lengths) <= 0:
            raise UserError(f"task.link_lengths: {self.link_lengths} must be three positive lengths, m")
        if len(self.start_angles) != 3:
            raise UserError(f"task.start_angles: {self.start_angles} must be three angles, rad")
        if self.max_speed <= 0:
            raise UserError(f"task.max_speed: {self.max_speed} must be positive, rad/s")


@dataclass(frozen=True)
class ReachAvoidReward:
    """Coefficients of eq. 3.2; the defaults are in configs/reward.

    Attributes:
      goal: discrete reward of a sample at the goal.
      obstacle: discrete reward of a sample inside an obstacle.
      c1: price of a metre from the goal.
      c2: gain of a metre from each obstacle.
      step: what step-based REPS has instead of the above, name => value.
    """

    goal: float
    obstacle: float
    c1: float
    c2: float
    step: dict[str, float]


@dataclass(frozen=True)
class VisitInOrderReward:
    """Coefficients of eq. 3.5; the defaults are in configs/reward.

    Attributes:
      goal: discrete reward of entering the goal that is next.
      wrong_order: discrete reward of entering any other goal, visited before or too early.
      obstacle: discrete reward of a sample inside an obstacle.
      c1: price of a metre from the goal that is next.
      c2: gain of a metre from each of the other goals.
      c3: gain of a metre from each obstacle.
      step: what step-based REPS has instead of the above, name => value.
    """

    goal: float
    wrong_order: float
    obstacle: float
    c1: float
    c2: float
    c3: float
    step: dict[str, float]


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
    camera = "above"
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
        features = np.empty((len(qpos), 8))
        features[:, 0:3], features[:, 3:6] = qpos, qvel
        features[:, 6:8] = forward_kinematics(qpos, self._link_lengths)
        return features

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
      constants: the spec's: goal (x, y), goal_radius, obstacle and obstacle_radius (families), m.

    Raises:
      UserError: if the spec has no such constants.
    """
    goal, goal_radius = required_constants(constants, goal=tuple, goal_radius=float)
    obstacles = _obstacles(constants)

    def discrete(signals: Mapping[str, Array]) -> Array:
        ee = signals["ee"]
        return np.select(
            [_distance(ee, goal) <= goal_radius, _inside(ee, obstacles)],
            [coefficients.goal, coefficients.obstacle],
            0.0,
        )

    def continuous(signals: Mapping[str, Array]) -> Array:
        ee = signals["ee"]
        return -coefficients.c1 * _distance(ee, goal) + coefficients.c2 * _distances(ee, obstacles)

    return {"discrete": discrete, "continuous": continuous}


def visit_in_order_rewards(coefficients: VisitInOrderReward, constants: Mapping[str, Any]) -> dict[str, StepReward]:
    """The discrete and the continuous reward of eq. 3.5, on the regions of the spec.

    The state vector that the case study adds, which goals were visited, is `goals_visited`. A goal is visited at
    the sample that enters its disc; staying inside is worth nothing. When all goals were visited none is next, and
    all are to be avoided.

    Args:
      coefficients: of eq. 3.5.
      constants: the spec's: goal (a family, in the order of the visits), goal_radius, obstacle and obstacle_radius
        (families), m.

    Raises:
      UserError: if the spec has no such constants.
    """
    family, goal_radius = required_constants(constants, goal=dict, goal_radius=float)
    goals = [np.array(goal) for goal in family.values()]
    obstacles = _obstacles(constants)

    def discrete(signals: Mapping[str, Array]) -> Array:
        ee = signals["ee"]
        inside = np.stack([_distance(ee, goal) <= goal_radius for goal in goals], axis=-1)  # (N, T, goals)
        entered = inside & ~np.concatenate([np.zeros_like(inside[:, :1]), inside[:, :-1]], axis=1)
        following = _before(goals_visited(inside))[..., None] == np.arange(len(goals))
        return np.select(
            [(entered & following).any(axis=-1), entered.any(axis=-1), _inside(ee, obstacles)],
            [coefficients.goal, coefficients.wrong_order, coefficients.obstacle],
            0.0,
        )

    def continuous(signals: Mapping[str, Array]) -> Array:
        ee = signals["ee"]
        distances = np.stack([_distance(ee, goal) for goal in goals], axis=-1)
        following = _before(goals_visited(distances <= goal_radius))[..., None] == np.arange(len(goals))
        weights = np.where(following, -coefficients.c1, coefficients.c2)
        return np.sum(weights * distances, axis=-1) + coefficients.c3 * _distances(ee, obstacles)

    return {"discrete": discrete, "continuous": continuous}


def goals_visited(inside: NDArray[np.bool_]) -> NDArray[np.int64]:
    """How many goals were visited in the right order up to each sample.

    Args:
      inside: whether the end-effector is in each goal, goals in order, shape (N, T, goals).

    Returns:
      Shape (N, T).
    """
    count = np.zeros(inside.shape[:2], dtype=np.int64)
    visited = np.ones(inside.shape[:2], dtype=np.bool_)
    for goal in range(inside.shape[2]):
        visited = np.logical_or.accumulate(inside[..., goal] & visited, axis=1)
        count += visited
    return count


def _before(count: NDArray[np.int64]) -> NDArray[np.int64]:
    """The count one sample earlier, 0 at the first."""
    return np.concatenate([np.zeros_like(count[:, :1]), count[:, :-1]], axis=1)


def _obstacles(constants: Mapping[str, Any]) -> list[tuple[Array, float]]:
    """Centre and radius of every obstacle."""
    centres, radii = required_constants(constants, obstacle=dict, obstacle_radius=dict)
    if centres.keys() != radii.keys():
        raise UserError(f"spec: obstacle has the members {list(centres)}, but obstacle_radius {list(radii)}")
    return [(np.array(centres[i]), radii[i]) for i in centres]


def _inside(points: Array, obstacles: list[tuple[Array, float]]) -> NDArray[np.bool_]:
    return np.any([_distance(points, centre) <= radius for centre, radius in obstacles], axis=0)


def _distances(points: Array, obstacles: list[tuple[Array, float]]) -> Array:
    return np.sum([_distance(points, centre) for centre, _ in obstacles], axis=0)


def _distance(points: Array, centre: Array) -> Array:
    """Euclidean distance, (..., 2) => (...)."""
    return np.asarray(np.sqrt(np.sum((points - centre) ** 2, axis=-1)))


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


def model_xml(link_lengths: Sequence[float], max_speed: float) -> str:
    """planar_arm.xml with the given link lengths (m) and command limit (rad/s)."""
    root = etree.fromstring(files("tltlrl.tasks").joinpath("planar_arm.xml").read_bytes())
    ends = ("./worldbody//body[@name='link_2']", "./worldbody//body[@name='link_3']", ".//site")
    for i, (length, end) in enumerate(zip(link_lengths, ends, strict=True), start=1):
        root.find(f".//geom[@name='link_{i}']").set("fromto", f"0 0 0 {length!r} 0 0")
        root.find(end).set("pos", f"{length!r} 0 0")
    root.find("./default/velocity").set("ctrlrange", f"{-max_speed!r} {max_speed!r}")
    return str(etree.tostring(root, encoding="unicode"))
