"""Trials on a changed model: other masses, friction, damping and starts than the policy was learned with."""

from __future__ import annotations

import contextlib
import re
from dataclasses import dataclass, fields

import mujoco
import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.learning.policy import Policy
from tltlrl.simulation.rollout import Simulator, Trajectories
from tltlrl.tasks.task import Task

Array = NDArray[np.float64]
Range = tuple[float, float]
NUMBER = re.compile(r"\d+(\.\d*)?|\.\d+")
MOST = 1e3  # largest factor, and largest spread of the start


@dataclass(frozen=True)
class Perturbation:
    """How much trials may differ from the model.

    Attributes:
      mass: least and greatest factor on all masses and inertias.
      friction: the same on the friction of all geoms and the dry friction in joints.
      damping: the same on the damping in all joints.
      start: standard deviation of the start in every joint, rad or m.
    """

    mass: Range = (1.0, 1.0)
    friction: Range = (1.0, 1.0)
    damping: Range = (1.0, 1.0)
    start: float = 0.0


def perturbation_of(text: str) -> Perturbation:
    """The perturbation that a text like `mass=0.8:1.2,start=0.02` describes.

    Raises:
      UserError: if it cannot be read; it says what is wrong.
    """
    names = [field.name for field in fields(Perturbation)]
    found: dict[str, Range | float] = {}
    for part in text.split(","):
        name, _, value = part.strip().partition("=")
        if name not in names or name in found:
            again = "; it stands there already" if name in found else nearest(name, names)
            raise UserError(f"--perturb {part.strip()}: expected one of {', '.join(names)}{again}")
        bounds = value.split(":")
        usual = "0.02" if name == "start" else "0.8:1.2"
        if len(bounds) != (1 if name == "start" else 2) or not all(NUMBER.fullmatch(bound) for bound in bounds):
            raise UserError(f"--perturb {part.strip()}: expected {name}={usual}")
        numbers = [float(bound) for bound in bounds]
        if numbers[-1] > MOST or numbers[0] > numbers[-1] or (numbers[0] == 0 and name == "mass"):
            raise UserError(
                f"--perturb {part.strip()}: expected numbers up to {MOST:g}, the lower first, and no mass of 0; "
                f"as {name}={usual}"
            )
        found[name] = numbers[0] if name == "start" else (numbers[0], numbers[1])
    return Perturbation(**found)  # type: ignore[arg-type]


def perturbed_trials(
    task: Task, policy: Policy, perturbation: Perturbation, size: float, count: int, rng: np.random.Generator
) -> tuple[Trajectories | None, int]:
    """Makes `count` trials of the mean policy, each with its own random factors and start.

    The same generator gives the same draws at every size, so that sizes are compared on the same trials.

    Args:
      task: a task with a model.
      policy: a policy of that task.
      perturbation: the perturbation at size 1.
      size: 0 (the unchanged model) to 1 (the whole ranges); a factor f becomes 1 + size (f - 1).
      count: number of trials.
      rng: source of the factors, the starts and the actuators' noise.

    Returns:
      The trials whose simulation did not diverge, if any, and how many did.
    """
    simulator = Simulator(task)
    model = simulator.model
    scratch = mujoco.MjData(model)
    changed = {
        "mass": (model.body_mass, model.body_inertia),
        "friction": (model.geom_friction, model.dof_frictionloss),
        "damping": (model.dof_damping,),
    }
    nominal = {name: [array.copy() for array in arrays] for name, arrays in changed.items()}
    motions = []
    for _ in range(count):
        noise, drawn = simulator.draw_command_noise(1, rng), simulator.draw_starts(1, rng)
        for name, arrays in changed.items():
            low, high = getattr(perturbation, name)
            factor = 1 + size * (rng.uniform(low, high) - 1)
            for array, own in zip(arrays, nominal[name], strict=True):
                array[:] = factor * own
        mujoco.mj_setConst(model, scratch)
        push = size * perturbation.start * rng.standard_normal((1, model.nv))
        starts = push if drawn is None else push + drawn
        with contextlib.suppress(FloatingPointError):  # a model that far off need not be one that can be simulated
            motions.append(simulator.rollout(policy.gain, policy.mean[None], noise, starts))
    if not motions:
        return None, count
    whole = (np.concatenate([getattr(motion, field.name) for motion in motions]) for field in fields(Trajectories))
    return Trajectories(*whole), count - len(motions)
