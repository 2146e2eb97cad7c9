"""A robot's page as a task."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
from dm_control.mujoco import Physics
from dm_control.mujoco.wrapper import MjModel
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.settings import check_value, settings_of
from tltlrl.tasks.mjcf import observed, poses, prepared, quantities
from tltlrl.tasks.mjcf.actuators import added_to, commanded, driven_joints, feedback_gains
from tltlrl.tasks.mjcf.evaluation import mistakes_at, trained_of
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.model import digest_of, model_path, page_digest
from tltlrl.tasks.mjcf.motion import holding_commands
from tltlrl.tasks.mjcf.page import check_overrides, task_name
from tltlrl.tasks.task import Array, Quantity, Signals, Task


class Robot(Task):
    """A robot from an MJCF file: features are positions and velocities of its joints, and what its sensors say."""

    def __init__(self, config: RobotConfig) -> None:
        """Reads the model, and finds everything in it that the page names.

        Raises:
          UserError: if the page has a mistake; it names file, line and key.
        """
        self.config = config
        check_overrides(trained_of(config))
        trained, at = trained_of(config), mistakes_at(config)
        if not config.file:
            raise UserError("task: a robot is described by a page; give its file, as in task=./arm.yaml (see tltl new)")
        for key, allowed in settings_of(RobotConfig).items():
            try:
                check_value("", getattr(config, key), allowed)
            except UserError as error:
                raise at(key)(str(error).removeprefix(": ")) from None
        self.name = task_name(Path(config.file))
        path = model_path(config.model, Path(config.file).parent, at("model"))
        digest = digest_of(path)
        if trained.digest and trained.digest != page_digest(trained):
            raise at("model")(
                "the model, or a file that it names, was changed since these results were made; put it back as it was, "
                "or train again under another name=..."
            )
        added = added_to(trained.actuators, at)
        bare = prepared.bare(path, digest, added, at)
        prepared.check_model(bare, config, at)
        self.control_timestep = config.control_timestep
        self.steps = prepared.steps_of(config, at)

        self._joints = quantities.names_in(bare, "joint")
        if config is not trained:
            own, self._joints = self._joints, Robot(trained)._joints
            lost = [name for name in self._joints if name not in own]
            if lost:
                raise at("model")(
                    f"it has no joint {lost[0]}, which the model of training has; a policy needs the same joints"
                )
        parts = observed.signals_named(bare, trained.signals, self._joints, at)
        sensed = {part.whole: part for named in parts.values() for part in named if part.field not in observed.STATE}
        chosen = commanded(bare, trained.commands, at)
        self._model = model = prepared.prepared(path, digest, added, tuple(sensed.values()), tuple(chosen))
        self._qpos, self._qvel = (np.array(found, dtype=int) for found in observed.state_places(model, self._joints))
        self._sensors = np.array(
            [place for part in sensed.values() for place in quantities.sensor_places(model, part)], dtype=int
        )
        self.sensed = self._sensor_values if sensed else None
        self.observation = observed.feature_groups(model, self._joints, sensed, at("model"))
        self._columns = observed.columns_of(parts, self.observation)
        self.end_effector = observed.first_place(parts)
        self.units = {
            name: ", ".join(dict.fromkeys(quantities.FIELDS[part.field].unit for part in named))
            for name, named in parts.items()
        }

        self.action = (Quantity("commands", "of the model", tuple(quantities.names_in(model, "actuator"))),)
        low, high = model.actuator_ctrlrange.T
        self.command_scale = (high - low) / 2
        self.command_noise = config.command_noise * self.command_scale
        columns = {("qpos", int(place)): i for i, place in enumerate(self._qpos)}
        columns |= {("qvel", int(place)): len(self._qpos) + i for i, place in enumerate(self._qvel)}
        driven = [("qvel", int(model.jnt_dofadr[joint])) for joint in driven_joints(model)]
        self._driven = np.array([columns[place] for place in driven if place in columns], dtype=np.intp)
        self.feedback = feedback_gains(model, trained.feedback, columns, self.width, at)

        self._start = poses.start_state(model, path, config, at)
        self.start_spread = np.full(model.nv, config.spread) if config.spread else None
        self.camera = config.camera
        if self.camera is not None and self.camera not in quantities.names_in(model, "camera"):
            there = nearest(self.camera, quantities.names_in(model, "camera")) or quantities.none("camera")
            raise at("camera")(f"the model has no camera {self.camera}{there}")
        sizes = {name: len(where) for name, where in self._columns.items()}
        self._ends_when = observed.end_formula(config.ends_when, sizes, at("ends_when"))
        points = poses.waypoints(model, self._start[0], trained.reference, at)
        samples = self.control_timestep * np.arange(self.steps, dtype=np.float64)
        self._reference = self._held(*poses.motion_through(model, points, self._start[1], samples), len(points) == 1)
        if self._ends_when is not None and self.terminated(self._reference[0][:1])[0]:
            raise at("ends_when")("it holds at the start already: no episode would begin")

    @property
    def joint_velocities(self) -> NDArray[np.intp] | None:
        """Where the velocities of the hinges and slides that the commands drive lie among the features.

        All of them where the commands drive none by itself, as through tendons.
        """
        return self._driven if len(self._driven) else None

    def make_physics(self) -> Physics:
        """A new `Physics`; the model is compiled only once."""
        return Physics.from_model(MjModel(copy.copy(self._model)))

    def initial_state(self) -> tuple[Array, Array]:
        """The start that the page, the keyframe or the model gives."""
        return self._start[0].copy(), self._start[1].copy()

    def features(self, qpos: Array, qvel: Array) -> Array:
        """Positions and velocities of the joints."""
        return np.concatenate([qpos[:, self._qpos], qvel[:, self._qvel]], axis=1)

    def _sensor_values(self, sensordata: Array) -> Array:
        return sensordata[:, self._sensors]

    def signals(self, features: Array, commands: Array) -> Signals:
        """The page's `signals`, and `command`; one number is a scalar, several are a vector."""
        found = {name: features[..., columns] for name, columns in self._columns.items()}
        found[observed.COMMAND] = commands
        return {name: values[..., 0] if values.shape[-1] == 1 else values for name, values in found.items()}

    def reference(self) -> tuple[Array, Array]:
        """The start, or straight lines between the waypoints, with the commands that hold this motion."""
        return self._reference[0].copy(), self._reference[1].copy()

    def terminated(self, features: Array) -> NDArray[np.bool_]:
        """Whether the page's `ends_when` holds at each sample, (N,)."""
        if self._ends_when is None:
            return super().terminated(features)
        unknown = np.zeros((len(features), 1, len(self.command_scale)))
        return np.asarray(self._ends_when.robustness(self.signals(features[:, None], unknown)) > 0)

    def _held(self, qpos: Array, qvel: Array, still: bool) -> tuple[Array, Array]:
        """Features and commands of a motion."""
        commands, sensordata = holding_commands(self._model, qpos, qvel, still)
        features = self.features(qpos, qvel)
        if self.sensed is not None:
            features = np.concatenate([features, self.sensed(sensordata)], axis=1)
        return features, commands
