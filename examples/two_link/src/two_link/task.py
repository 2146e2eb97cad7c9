"""An arm of two links in the plane, as a task for tltlrl."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from tltlrl.settings import check, setting
from tltlrl.tasks.task import Array, Joints, Memory, Quantity, Signals, StepReward, Task, TaskEntry, required_constants

# isort: split
from dm_control import mujoco  # after tltlrl.tasks, which chooses a renderer that needs no display

FOLDER = files("two_link")


@dataclass(frozen=True)
class TwoLinkConfig:
    """What `tltl-run task=two_link task.steps=80` can change."""

    name: str = setting("of the task", "two_link")
    steps: int = setting("samples of one episode, 20 a second", 60, least=2)
    start_angles: list[float] = setting("of shoulder and elbow, rad", [0.3, 0.5])
    command_noise: float = setting("standard deviation of the actuators' noise, rad/s", 0.02, least=0)

    def __post_init__(self) -> None:
        check(self, "task")


class TwoLink(Task):
    """The arm, driven by the speeds of its joints."""

    control_timestep = 0.05  # s
    observation = (
        Quantity("angles", "rad", ("shoulder", "elbow")),
        Quantity("velocities", "rad/s", ("shoulder_speed", "elbow_speed")),
        Quantity("end_effector", "m", ("x", "y")),
    )
    action = (Quantity("speeds", "rad/s", ("shoulder", "elbow")),)
    camera = "above"
    joints = Joints()
    end_effector = "end_effector"

    def __init__(self, config: TwoLinkConfig) -> None:
        self.name, self.steps, self.start = config.name, config.steps, np.array(config.start_angles)
        self.command_scale = np.full(2, 2.0)  # rad/s, as in the model
        self.command_noise = np.full(2, config.command_noise)
        self.feedback = np.eye(2, self.width)  # on the angles, the first two features
        self.skeleton = self.points

    def make_physics(self) -> mujoco.Physics:
        return mujoco.Physics.from_xml_string(FOLDER.joinpath("arm.xml").read_text())

    def initial_state(self) -> tuple[Array, Array]:
        return self.start, np.zeros(2)

    def features(self, qpos: Array, qvel: Array) -> Array:
        return np.concatenate([qpos, qvel, joints(qpos)[:, -1]], axis=1)

    def signals(self, features: Array, commands: Array) -> Signals:
        elbow = features[..., self.slices["angles"]][..., 1]
        return {"ee": features[..., self.slices["end_effector"]], "bend": np.abs(np.sin(elbow)), "command": commands}

    def reference(self) -> tuple[Array, Array]:
        rest = self.features(self.start[None], np.zeros((1, 2)))
        return np.repeat(rest, self.steps, axis=0), np.zeros((self.steps, 2))

    def points(self, features: Array) -> Array:
        return joints(features[..., self.slices["angles"]])


def joints(angles: Array) -> Array:
    """Base, elbow and end, m: (..., 2) rad => (..., 3, 2)."""
    headings = np.cumsum(angles, axis=-1)
    links = np.stack([np.cos(headings), np.sin(headings)], axis=-1)
    return np.concatenate([np.zeros_like(links[..., :1, :]), np.cumsum(links, axis=-2)], axis=-2)


@dataclass(frozen=True)
class TwoLinkReward:
    """The coefficient of the hand-made reward."""

    price: float = setting("of a metre from the goal", 1.0)
    step: dict[str, float] = setting("other values for step-based learners", {})


def rewards(coefficients: TwoLinkReward, constants: Mapping[str, Any]) -> dict[str, StepReward]:
    """`distance`: the closer to the goal of the spec, the better."""
    (goal,) = required_constants(constants, goal=tuple)

    def distance(signals: Signals, memory: Memory = None) -> tuple[Array, Memory]:
        return -coefficients.price * np.linalg.norm(signals["ee"] - np.array(goal), axis=-1), memory

    return {"distance": distance}


TWO_LINK = TaskEntry(
    config=TwoLinkConfig,
    make=TwoLink,
    spec=str(FOLDER.joinpath("two_link.tltl")),
    reward=TwoLinkReward,
    rewards=rewards,
    hand_made=("distance",),
)
