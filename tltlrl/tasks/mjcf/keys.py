"""The table of keys of a robot's page: the meaning, the bounds and an example of each key.

The reader of pages, its messages and docs/robot-yaml.md all use this table.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tltlrl.settings import Role, Setting, setting, settings_of

NUMBER, WORD, TEXT, NAMES = "a number", "a word", "a text", "a list of names"
NUMBERS_BY_NAME, SETTINGS = "names and numbers, as {elbow: 0.3}", "keys and values, as {model: solid.xml}"
FEEDBACK = "actuators and gains, as {elbow: -1}"
ACTUATORS = "joints and actuators, as {elbow: {motor: 10, range: 1}}"
MOTION = "hold, or a list of waypoints, as [{time: 1, elbow: 0.3}]"
SIGNALS = "names and what they stand for, as {tip: site_xpos.tip}"


@dataclass(frozen=True)
class RobotConfig:
    """A robot's page as it was read, and where it was. Every key of a page but `model` has a default."""

    name: str = setting("mjcf, for every robot that is described by a page", "mjcf")
    file: str = setting("the page; it is known by its content, wherever it is", "", role=Role.PLACE)
    digest: str = setting("digest of the model's files, so that a changed model is noticed", "")
    model: str = setting(
        "an MJCF file: a path from the page's folder, or package:path of an installed package",
        "",
        kind=TEXT,
        example="arm.xml",
    )
    duration: float = setting("length of one episode, s", 5.0, above=0, kind=NUMBER, example="5.0", role=Role.COMMON)
    control_timestep: float = setting(
        "time between two commands, s; a multiple of the model's timestep",
        0.05,
        above=0,
        kind=NUMBER,
        example="0.05",
        role=Role.COMMON,
    )
    start: dict[str, Any] = setting(
        "joint positions at the start, rad or m, by the joints' names; others are as in the keyframe or the model",
        {},
        kind=NUMBERS_BY_NAME,
        example="{shoulder: 0.3}",
    )
    keyframe: str | None = setting("a keyframe of the model, to start from", None, kind=WORD, example="home")
    spread: float = setting(
        "standard deviation of the start, rad or m in every joint; it is drawn anew for each trajectory",
        0.0,
        least=0,
        kind=NUMBER,
        example="0.02",
    )
    actuators: dict[str, Any] = setting(
        "actuators that are added to the model, by the joints that they drive: motor (its gear), position (kp, and "
        "damping: kv) or velocity (kv), with the range of their commands and, if limited, their force, N or N m",
        {},
        kind=ACTUATORS,
        example="{elbow: {velocity: 50, range: [-1, 1], force: 30}}",
        role=Role.COMMON,
    )
    commands: list[str] = setting(
        "the actuators that the policy commands, all if none is named; others are taken out of the model",
        [],
        kind=NAMES,
        example="[shoulder, elbow]",
        role=Role.COMMON,
    )
    command_noise: float = setting(
        "standard deviation of the actuators' noise, as a share of a full command",
        0.01,
        least=0,
        most=10,
        kind=NUMBER,
        example="0.01",
    )
    feedback: dict[str, Any] = setting(
        "by the actuators' names, what is added to a command, in its unit, per rad or m that its joint is off the "
        "reference; negative pulls back. Or two numbers, the second per rad/s or m/s; or other joints with theirs",
        {},
        kind=FEEDBACK,
        example="{shoulder: -1, elbow: {elbow: [-1, -0.1], wrist: 0.2}}",
        role=Role.COMMON,
    )
    reference: Any = setting(
        "the motion that learning starts from: hold stays at the start; waypoints, each a time, s, and joint "
        "positions, are joined by straight lines",
        "hold",
        kind=MOTION,
        example="[{time: 2, shoulder: 1.2}, {time: 4, shoulder: 0.5, elbow: 1}]",
        role=Role.COMMON,
    )
    signals: dict[str, Any] = setting(
        "what a spec can speak of, beside command; the path of the first that is a position is measured; if none is "
        "named: all sensors of the model by name, qpos and qvel",
        {},
        kind=SIGNALS,
        example="{tip: site_xpos.tip, angles: [qpos.shoulder, qpos.elbow]}",
        role=Role.COMMON,
    )
    ends_when: str | None = setting(
        "an episode ends early where this formula of the language holds", None, kind=TEXT, example="tip.z < 0"
    )
    evaluation: dict[str, Any] = setting(
        "other values of these keys for the trials of what was learned, such as a more truthful model",
        {},
        kind=SETTINGS,
        example="{model: solid.xml}",
        role=Role.COMMON,
    )
    camera: str | None = setting("a camera of the model, for films", None, kind=WORD, example="front")


# The keys of a page, in the order of the table.
KINDS: Mapping[str, Setting] = {name: its for name, its in settings_of(RobotConfig).items() if its.kind}
COMMON = [name for name in KINDS if Role.COMMON in KINDS[name].role]
