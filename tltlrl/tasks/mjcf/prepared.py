"""Prepares the model for simulation: adds the page's sensors and actuators, and checks it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import mujoco

from tltlrl.tasks.mjcf import quantities
from tltlrl.tasks.mjcf.actuators import Added, add_actuators, check_added
from tltlrl.tasks.mjcf.evaluation import At
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.model import compiled, read_model
from tltlrl.tasks.mjcf.quantities import ModelQuantity
from tltlrl.tasks.task import MOST_STEPS


def bare(path: Path, digest: str, added: tuple[Added, ...], at: At) -> mujoco.MjModel:
    """The model with the page's actuators, in which names are looked up.

    Args:
      path: of the MJCF file.
      digest: of its content.
      added: actuators.
      at: tells mistakes.

    Raises:
      UserError: if MuJoCo cannot read the model, or an actuator has no joint.
    """
    if added:
        check_added(read_model(path), added, at)
    return prepared(path, digest, added)


@lru_cache(maxsize=8)
def prepared(
    path: Path,
    digest: str,  # noqa: ARG001  # another one makes it another model
    added: tuple[Added, ...] = (),
    measures: tuple[ModelQuantity, ...] = (),
    commanded: tuple[str, ...] | None = None,
) -> mujoco.MjModel:
    """The model with added actuators, sensors for all quantities, and only the commanded actuators."""
    spec = read_model(path)
    add_actuators(spec, added)
    quantities.add_sensors(spec, measures)
    others = [actuator for actuator in spec.actuators if commanded is not None and actuator.name not in commanded]
    for actuator in others:
        spec.delete(actuator)
    if others:
        for key in spec.keys:  # their numbers belong to all the actuators
            key.ctrl, key.act = [], []
    return compiled(path, spec)


def check_model(model: mujoco.MjModel, config: RobotConfig, at: At) -> None:
    """Checks that the model has a command, and that its timestep divides the control timestep.

    Raises:
      UserError: if it does not.
    """
    told = at("model")
    if not model.nu:
        raise told(
            "the model has no actuators; a policy needs some to command; add <actuator> to the MJCF file, or "
            "actuators: to the page"
        )
    if not model.njnt:
        raise told("the model has no joints: nothing in it can move; add <joint> to a body of the MJCF file")
    timestep = float(model.opt.timestep)
    asked = config.control_timestep
    substeps = asked / timestep
    if round(substeps) < 1 or abs(substeps - round(substeps)) > 1e-6:
        near = max(round(substeps), 1) * timestep
        raise at("control_timestep")(
            f"{asked:g} s is no multiple of the model's timestep of {timestep:g} s; write {near:.6g}, or change "
            "that in the MJCF file"
        )


def steps_of(config: RobotConfig, at: At) -> int:
    """The number of samples of an episode.

    Raises:
      UserError: if there are too few or too many.
    """
    steps = round(config.duration / config.control_timestep)
    if steps < 2:
        raise at("duration")(f"{config.duration:g} s hold {steps} samples; at least 2 are needed")
    if steps > MOST_STEPS:
        raise at("duration")(f"{config.duration:g} s hold {steps} samples; at most {MOST_STEPS} are possible")
    return steps
