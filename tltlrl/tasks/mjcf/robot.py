"""The task that a robot's page describes."""

from __future__ import annotations

import copy
import dataclasses
import keyword
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from dm_control.mujoco import Physics
from dm_control.mujoco.wrapper import MjModel
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.logic import Spec, SpecError, parse_spec
from tltlrl.settings import check_value, setting, settings_of
from tltlrl.tasks.mjcf import quantities
from tltlrl.tasks.mjcf.keys import KINDS, RobotConfig
from tltlrl.tasks.mjcf.model import compiled, digest_of, model_path, read_model
from tltlrl.tasks.mjcf.motion import holding_commands
from tltlrl.tasks.mjcf.page import Key, mistake
from tltlrl.tasks.mjcf.quantities import Measure
from tltlrl.tasks.task import MOST_STEPS, Array, Quantity, Signals, Task

COMMAND = "command"
STATE = ("qpos", "qvel")  # the fields that need no sensor
OF_JOINT = (mujoco.mjtTrn.mjTRN_JOINT.value, mujoco.mjtTrn.mjTRN_JOINTINPARENT.value)
SINGLE = (mujoco.mjtJoint.mjJNT_HINGE.value, mujoco.mjtJoint.mjJNT_SLIDE.value)


@dataclass(frozen=True)
class EvaluationConfig(RobotConfig):
    """A page with the other values of its key `evaluation`.

    Attributes:
      trained: the page itself: features stay what they are there, whatever else the scene holds.
    """

    trained: RobotConfig = setting("the page itself", RobotConfig())


def evaluation_of(config: RobotConfig) -> RobotConfig:
    """The scene that what was learned is tried in."""
    if not config.evaluation:
        return config
    values = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    return EvaluationConfig(**values | config.evaluation, trained=config)


class Robot(Task):
    """A robot from an MJCF file: features are positions and velocities of its joints, and what its sensors say."""

    def __init__(self, config: RobotConfig) -> None:
        """Reads the model and finds everything that the page names in it.

        Raises:
          UserError: naming file, line and key of what cannot be.
        """
        self.config = config
        self.trained = config.trained if isinstance(config, EvaluationConfig) else config
        if not config.file:
            raise UserError("task: a robot is described by a page; give its file, as in task=./arm.yaml (see tltl new)")
        for key, allowed in settings_of(RobotConfig).items():
            try:
                check_value("", getattr(config, key), allowed)
            except UserError as error:
                raise self._mistake(key)(str(error).removeprefix(": ")) from None
        self.name = task_name(Path(config.file))
        self._path = model_path(config.model, Path(config.file).parent, self._mistake("model"))
        self._digest = digest_of(self._path)
        self._check_digest()
        bare = _prepared(self._path, self._digest)
        self._check_model(bare)
        self.control_timestep = config.control_timestep
        self.steps = self._steps()
        self._joints = self._joints_of_features(bare)
        self._quantities = self._signals_named(bare)
        commanded = self._commanded(bare)
        sensed = {part.whole: part for parts in self._quantities.values() for part in parts if part.field not in STATE}
        self._model = model = _prepared(self._path, self._digest, tuple(sensed.values()), tuple(commanded))
        low, high = model.actuator_ctrlrange.T
        self.command_scale = (high - low) / 2
        self.command_noise = config.command_noise * self.command_scale
        self._qpos, self._qvel = (np.array(places, dtype=int) for places in self._state_places())
        self._sensors = np.array(
            [place for part in sensed.values() for place in quantities.sensor_places(model, part)], dtype=int
        )
        self.sensed = self._sensor_values if sensed else None
        self.observation = self._groups(sensed)
        self.action = (Quantity("commands", "of the model", tuple(quantities.names_in(model, "actuator"))),)
        self._columns = self._columns_of_signals()
        self.units = {
            name: ", ".join(dict.fromkeys(quantities.FIELDS[part.field].unit for part in parts))
            for name, parts in self._quantities.items()
        }
        self._start = self._start_state()
        self.start_spread = np.full(model.nv, config.spread) if config.spread else None
        self.feedback = self._feedback()
        self.camera = config.camera
        if self.camera is not None and self.camera not in quantities.names_in(model, "camera"):
            there = nearest(self.camera, quantities.names_in(model, "camera")) or quantities.none("camera")
            raise self._mistake("camera")(f"the model has no camera {self.camera}{there}")
        self._ends_when = self._end()
        self._waypoints = self._read_waypoints()
        self._reference = self._motion()
        self._check_end()

    # What the contract of a task asks for

    def make_physics(self) -> Physics:
        """A physics of its own; the model is compiled once."""
        return Physics.from_model(MjModel(copy.copy(self._model)))

    def initial_state(self) -> tuple[Array, Array]:
        """The start: of the page, the keyframe, or the model."""
        return self._start[0].copy(), self._start[1].copy()

    def features(self, qpos: Array, qvel: Array) -> Array:
        """Positions and velocities of the joints."""
        return np.concatenate([qpos[:, self._qpos], qvel[:, self._qvel]], axis=1)

    def _sensor_values(self, sensordata: Array) -> Array:
        return sensordata[:, self._sensors]

    def signals(self, features: Array, commands: Array) -> Signals:
        """What the page's `signals` name, and `command`; a single number is a scalar, more are a vector."""
        found = {name: features[..., columns] for name, columns in self._columns.items()}
        found[COMMAND] = commands
        return {name: values[..., 0] if values.shape[-1] == 1 else values for name, values in found.items()}

    def reference(self) -> tuple[Array, Array]:
        """The start kept up, or straight lines between the waypoints, with the commands that hold them."""
        return self._reference[0].copy(), self._reference[1].copy()

    def terminated(self, features: Array) -> NDArray[np.bool_]:
        """Where the page's `ends_when` holds."""
        if self._ends_when is None:
            return super().terminated(features)
        unknown = np.zeros((len(features), 1, len(self.command_scale)))
        return np.asarray(self._ends_when.robustness(self.signals(features[:, None], unknown)) > 0)

    # What the page says of itself, checked

    def _mistake(self, *key: str) -> Callable[[str], UserError]:
        if self.config is not self.trained and key[0] in self.config.evaluation:
            return lambda what: mistake(self.config, key, what, ("evaluation",))
        return lambda what: mistake(self.trained, key, what)

    def _check_digest(self) -> None:
        if self.trained.digest and self.trained.digest != page_digest(self.trained):
            raise self._mistake("model")(
                "the model, or a file that it names, was changed since these results were made; put it back as it was, "
                "or train again under another name=..."
            )

    def _check_model(self, model: mujoco.MjModel) -> None:
        told = self._mistake("model")
        if not model.nu:
            raise told("the model has no actuators; a policy needs some to command; add <actuator> to the MJCF file")
        if not model.njnt:
            raise told("the model has no joints: nothing in it can move; add <joint> to a body of the MJCF file")
        timestep = float(model.opt.timestep)
        asked = self.config.control_timestep
        substeps = asked / timestep
        if round(substeps) < 1 or abs(substeps - round(substeps)) > 1e-6:
            near = max(round(substeps), 1) * timestep
            raise self._mistake("control_timestep")(
                f"{asked:g} s is no multiple of the model's timestep of {timestep:g} s; write {near:.6g}, or change "
                "that in the MJCF file"
            )

    def _steps(self) -> int:
        steps = round(self.config.duration / self.config.control_timestep)
        told = self._mistake("duration")
        if steps < 2:
            raise told(f"{self.config.duration:g} s hold {steps} samples; at least 2 are needed")
        if steps > MOST_STEPS:
            raise told(f"{self.config.duration:g} s hold {steps} samples; at most {MOST_STEPS} are possible")
        return steps

    def _joints_of_features(self, model: mujoco.MjModel) -> list[str]:
        """The joints of the model of training, all of them also in this one."""
        here = quantities.names_in(model, "joint")
        if self.config is self.trained:
            return here
        trained = Robot(self.trained)
        lost = [name for name in trained._joints if name not in here]
        if lost:
            raise self._mistake("model")(
                f"it has no joint {lost[0]}, which the model of training has; a policy needs the same joints"
            )
        return trained._joints

    def _signals_named(self, model: mujoco.MjModel) -> dict[str, list[Measure]]:
        """Signal => the quantities that it is made of, one after the other."""
        given = self.trained.signals
        if not given:
            return self._default_signals(model)
        found = {}
        for name, addresses in given.items():
            told = self._mistake("signals", name)
            if name == COMMAND:
                raise told("it is always what the policy sends; choose another name")
            check_signal_name(name, told)
            parts = addresses if isinstance(addresses, list) else [addresses]
            found[name] = [quantities.find(str(part), model, told) for part in parts]
        return found

    def _default_signals(self, model: mujoco.MjModel) -> dict[str, list[Measure]]:
        def told(what: str) -> UserError:
            return self._mistake("model")(what)

        found = {field: [quantities.find(f"{field}.{name}", model, told) for name in self._joints] for field in STATE}
        for name in quantities.names_in(model, "sensor"):
            if name.isidentifier() and name not in (*STATE, COMMAND) and _speakable(name):
                found[name] = [quantities.find(f"sensordata.{name}", model, told)]
        return found

    def _commanded(self, model: mujoco.MjModel) -> list[str]:
        """The actuators that are commanded."""
        names = quantities.names_in(model, "actuator")
        chosen = list(self.trained.commands) or names
        for i, name in enumerate(chosen):
            told = self._mistake("commands", str(i)) if self.trained.commands else self._mistake("commands")
            if name not in names:
                raise told(f"the model has no actuator {name}{nearest(name, names)}")
            if chosen.index(name) < i:
                raise told(f"{name} is there before; name each once")
            low, high = model.actuator_ctrlrange[names.index(name)]
            if not model.actuator_ctrllimited[names.index(name)] or not low < high:
                raise told(
                    f"the actuator {name} has no range, so nobody knows what a full command is; give it "
                    'ctrlrange="LOW HIGH" in the MJCF file'
                )
        return chosen

    def _state_places(self) -> tuple[list[int], list[int]]:
        """Where the joints of the features lie in qpos and in qvel."""
        there = quantities.names_in(self._model, "joint")
        qpos: list[int] = []
        qvel: list[int] = []
        for name in self._joints:
            i = there.index(name)
            sizes = [max(len(parts), 1) for parts in quantities.JOINT_PARTS[int(self._model.jnt_type[i])]]
            qpos += range(self._model.jnt_qposadr[i], self._model.jnt_qposadr[i] + sizes[0])
            qvel += range(self._model.jnt_dofadr[i], self._model.jnt_dofadr[i] + sizes[1])
        return qpos, qvel

    def _groups(self, sensed: Mapping[str, Measure]) -> tuple[Quantity, ...]:
        def told(what: str) -> UserError:
            return self._mistake("model")(what)

        groups = []
        for field in STATE:
            parts = [quantities.find(f"{field}.{name}", self._model, told) for name in self._joints]
            labels = tuple(label for part in parts for label in _labels(part))
            groups.append(Quantity(field, quantities.FIELDS[field].unit, labels))
        groups += [
            Quantity(address, quantities.FIELDS[part.field].unit, _labels(part)) for address, part in sensed.items()
        ]
        return tuple(groups)

    def _columns_of_signals(self) -> dict[str, list[int]]:
        """Signal => where its values lie among the features."""
        labels = [label for group in self.observation for label in group.parts]
        columns = {}
        for name, parts in self._quantities.items():
            wanted = [
                label
                for part in parts
                for i, label in enumerate(_labels(part))
                if part.chosen is None or i == part.chosen
            ]
            columns[name] = [labels.index(label) for label in wanted]
        return columns

    def _start_state(self) -> tuple[Array, Array]:
        model, config = self._model, self.config
        qpos, qvel = np.array(model.qpos0), np.zeros(model.nv)
        if config.keyframe is not None:
            names = quantities.names_in(model, "keyframe")
            if config.keyframe not in names:
                there = nearest(config.keyframe, names) or quantities.none("keyframe")
                raise self._mistake("keyframe")(f"the model has no keyframe {config.keyframe}{there}")
            key = names.index(config.keyframe)
            written = len(read_model(self._path).keys[key].qpos)
            if written not in (0, model.nq):  # MuJoCo fills up what is missing
                raise self._mistake("keyframe")(
                    f"{config.keyframe} has {written} positions, the model {model.nq}; correct its qpos in "
                    "the MJCF file"
                )
            qpos, qvel = np.array(model.key_qpos[key]), np.array(model.key_qvel[key])
        for name, value in config.start.items():
            self._place(qpos, name, value, self._mistake("start", name))
        return qpos, qvel

    def _place(self, qpos: Array, name: str, value: Any, told: Callable[[str], UserError]) -> None:
        """Puts a joint where a page says."""
        model, names = self._model, quantities.names_in(self._model, "joint")
        if name not in names:
            raise told(f"the model has no joint {name}{nearest(name, names)}")
        joint = names.index(name)
        parts = quantities.JOINT_PARTS[int(model.jnt_type[joint])][0]
        values = np.atleast_1d(np.array(value, dtype=float))
        if len(values) != max(len(parts), 1):
            expected = f"{len(parts)} numbers ({', '.join(parts)})" if parts else "one number"
            raise told(f"expected {expected}, not {len(values)}")
        if not np.isfinite(values).all():
            raise told(f"{value} is not finite")
        low, high = model.jnt_range[joint]
        if model.jnt_limited[joint] and not parts and not low <= values[0] <= high:
            raise told(f"{value:g} is out of the joint's range from {low:.6g} to {high:.6g}")
        where = model.jnt_qposadr[joint]
        qpos[where : where + len(values)] = values

    def _feedback(self) -> Array:
        """K for algorithm.feedback=-1, its default, is what the page says."""
        model = self._model
        names = quantities.names_in(model, "actuator")
        gain = np.zeros((model.nu, self.width))
        for name, value in self.trained.feedback.items():
            told = self._mistake("feedback", name)
            if name not in names:
                raise told(f"there is no command {name}{nearest(name, names)}")
            gains = value if isinstance(value, list) else [value]
            if len(gains) > 2 or not np.isfinite(gains).all():
                raise told("expected one number or two, for position and velocity")
            row = names.index(name)
            joint = int(model.actuator_trnid[row, 0])
            if model.actuator_trntype[row] not in OF_JOINT or model.jnt_type[joint] not in SINGLE:
                raise told(
                    f"the actuator {name} drives no single joint, so there is nothing to feed back; leave it out"
                )
            for number, field, places in zip(gains, STATE, (self._qpos, self._qvel), strict=False):
                address = (model.jnt_qposadr if field == "qpos" else model.jnt_dofadr)[joint]
                gain[row, self.slices[field].start + int(np.flatnonzero(places == address)[0])] = -number
        return gain

    def _end(self) -> Spec | None:
        text = self.config.ends_when
        if text is None:
            return None
        told = self._mistake("ends_when")
        sizes = {name: len(columns) for name, columns in self._columns.items()}
        declared = [f"signal {name}{f'[{size}]' * (size > 1)}\n" for name, size in sizes.items()]
        try:
            spec = parse_spec(f"{''.join(declared)}spec: {text}")
        except SpecError as error:
            raise told(f"{error.problem}\n    {text}") from None
        if spec.counts_seconds or spec.horizon != 0:
            raise told("it is asked at every sample by itself; leave out what looks at other samples, as F, G and X")
        return spec

    def _check_end(self) -> None:
        features = self._reference[0][:1]
        if self._ends_when is not None and self.terminated(features)[0]:
            raise self._mistake("ends_when")("it holds at the start already: no episode would begin")

    def _read_waypoints(self) -> list[tuple[float, Array]]:
        """Time and positions (nq,) of every waypoint, the start first; only the start to hold it."""
        reference = self.trained.reference
        points = [(0.0, self._start[0])]
        if reference == "hold":
            return points
        if not isinstance(reference, list):
            raise self._mistake("reference")(f"expected {KINDS['reference'].kind}, not {reference!r}")
        for i, waypoint in enumerate(reference):
            told = self._mistake("reference", str(i))
            if "time" not in waypoint:
                raise told("it has no time; begin it with time: SECONDS")
            time, qpos = float(waypoint["time"]), points[-1][1].copy()
            if not time > points[-1][0] or not math.isfinite(time):
                raise told(f"its time {time:g} s must be after {points[-1][0]:g} s")
            for name, value in waypoint.items():
                if name != "time":
                    self._place(qpos, name, value, self._mistake("reference", str(i), name))
            points.append((time, qpos))
        return points

    def _motion(self) -> tuple[Array, Array]:
        model = self._model
        times = np.array([time for time, _ in self._waypoints])
        path = np.array([qpos for _, qpos in self._waypoints])
        samples = np.arange(self.steps) * self.control_timestep
        qpos = np.stack([np.interp(samples, times, column) for column in path.T], axis=-1)
        qvel = np.zeros((self.steps, model.nv))
        for t in range(self.steps - 1):
            mujoco.mj_differentiatePos(model, qvel[t], self.control_timestep, qpos[t], qpos[t + 1])
        if len(times) == 1:
            qvel[0] = self._start[1]
        commands, sensordata = holding_commands(model, qpos, qvel, still=len(times) == 1)
        features = self.features(qpos, qvel)
        if self.sensed is not None:
            features = np.concatenate([features, self.sensed(sensordata)], axis=1)
        return features, commands


def check_signal_name(name: str, told: Callable[[str], UserError]) -> None:
    """Whether a spec can speak of a signal of that name.

    Raises:
      UserError: if not.
    """
    if not name.isidentifier():
        raise told(f"{name} cannot be a name in a spec; use letters, digits and _, a letter first")
    if not _speakable(name):
        raise told(f"{name} is a word of the language; choose another name")


def _speakable(name: str) -> bool:
    try:
        parse_spec(f"signal {name}\nspec: F {name} > 0")
    except SpecError:
        return False
    return True


def task_name(file: Path) -> str:
    """The name of a robot's task: that of its page, as one word."""
    word = "".join(c if c.isalnum() or c == "_" else "_" for c in file.stem)
    return word if word.isidentifier() and not keyword.iskeyword(word) else f"robot_{word}"


def page_digest(config: RobotConfig) -> str:
    """Of the files of the model, and of that of the evaluation."""
    folder = Path(config.file).parent
    path = model_path(config.model, folder, lambda what: mistake(config, ("model",), what))
    paths = [path]
    if "model" in config.evaluation:
        there: Key = ("evaluation", "model")
        paths.append(model_path(config.evaluation["model"], folder, lambda what: mistake(config, there, what)))
    return "-".join(digest_of(path)[:32] for path in paths)


def _labels(part: Measure) -> tuple[str, ...]:
    """Names of all components of a quantity, as its features are called."""
    return tuple(f"{part.whole}.{component}" for component in part.parts) or (part.whole,)


@lru_cache(maxsize=8)
def _prepared(
    path: Path,
    digest: str,  # noqa: ARG001  # another one makes it another model
    measures: tuple[Measure, ...] = (),
    commanded: tuple[str, ...] | None = None,
) -> mujoco.MjModel:
    """The model with sensors for what is measured, and without the actuators that are not commanded."""
    spec = read_model(path)
    quantities.add_sensors(spec, measures)
    others = [
        actuator
        for i, actuator in enumerate(spec.actuators)
        if commanded is not None and (actuator.name or f"actuator_{i}") not in commanded
    ]
    for actuator in others:
        spec.delete(actuator)
    if others:
        for key in spec.keys:  # their numbers belong to all the actuators
            key.ctrl, key.act = [], []
    return compiled(path, spec)
