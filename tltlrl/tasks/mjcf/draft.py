"""Drafts a page for a model, and a spec: likely choices, with the alternatives as comments."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from tltlrl.logic import is_signal_name
from tltlrl.tasks.mjcf import quantities
from tltlrl.tasks.mjcf.actuators import drives_one, sets_speed
from tltlrl.tasks.mjcf.model import Told
from tltlrl.tasks.mjcf.observed import COMMAND, STATE

Array = NDArray[np.float64]
CONTROL_TIMESTEP = 0.05  # s, about
TIP = "tip"


def draft_page(model: mujoco.MjModel, path: str, told: Told) -> str:
    """The text of a page.

    Args:
      model: the compiled model.
      path: the model's path as the page will give it.
      told: makes the error for a mistake in the model.

    Raises:
      UserError: if no site, body or geom of the model has a name that a spec could use.
    """
    timestep = float(model.opt.timestep)
    names = {of: quantities.named(model, of) for of in quantities.NAMED}
    actuators = quantities.names_in(model, "actuator")
    lines = [
        "# A robot for tltlrl. Every key: docs/robot-yaml.md; what a spec can speak of: tltl tasks THIS_FILE.",
        "",
        f"model: {path}",
        "duration: 5.0                # s",
        f"control_timestep: {max(round(CONTROL_TIMESTEP / timestep), 1) * timestep:.6g}       # s",
        *(f"{'' if i == 0 else '# '}keyframe: {name}" for i, name in enumerate(names["keyframe"])),
        f"# start: {{{quantities.names_in(model, 'joint')[0]}: 0.0}}  # rad or m; joints: "
        + ", ".join(quantities.names_in(model, "joint")),
        "# spread: 0.02               # of the start, rad or m",
        f"commands: [{', '.join(actuators)}]",
        "command_noise: 0.01          # share of a full command",
        *_feedback(model, actuators),
        "reference: hold",
        "signals:",
        f"  {TIP}: {likely_tip(model, told)}",
        "  qpos: [" + ", ".join(f"qpos.{name}" for name in quantities.names_in(model, "joint")) + "]",
        "  qvel: [" + ", ".join(f"qvel.{name}" for name in quantities.names_in(model, "joint")) + "]",
        *(f"  # {_signal(name)}: sensordata.{name}" for name in names["sensor"]),
        *(f"  # {_word(name)}_place: site_xpos.{name}" for name in names["site"]),
        "# ends_when: tip.z < 0",
        *(f"{'' if i == 0 else '# '}camera: {name}" for i, name in enumerate(names["camera"])),
    ]
    return "\n".join(lines) + "\n"


def draft_spec(goal: Array, radius: float, seconds: float) -> str:
    """The text of a spec: reach a place in time and stay there.

    Args:
      goal: a place that the tip can reach, shape (3,), m.
      radius: radius of the goal, m.
      seconds: within which it is to be reached.
    """
    place = ", ".join(f"{x:.3g}" for x in goal)
    return f"""\
# Reach a place within {seconds:.2g} s and stay there. The robot came to this place under random commands.

signal tip[3]                       # m

const goal = ({place})
const radius = {radius:.2g}         # m

def at_goal: distance(tip, goal) < radius

spec: F[0 s, {seconds:.2g} s] G at_goal
"""


def likely_tip(model: mujoco.MjModel, told: Told) -> str:
    """The quantity of the likely tip: a named site, body or geom as far as possible down the tree of bodies.

    What no joint displaces is none, such as a body whose frame lies on its only hinge.

    Raises:
      UserError: if none of them has a name.
    """
    depth = np.zeros(model.nbody, dtype=int)
    for body in range(1, model.nbody):
        depth[body] = depth[model.body_parentid[body]] + (model.body_dofnum[body] > 0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    candidates: list[tuple[int, int, int, str]] = []
    owners: tuple[tuple[str, str, Sequence[int]], ...] = (
        ("site", "site_xpos", model.site_bodyid),
        ("body", "xpos", range(model.nbody)),
        ("geom", "geom_xpos", model.geom_bodyid),
    )
    for rank, (of, field, bodies) in enumerate(owners):
        for i, name in enumerate(quantities.names_in(model, of)):
            if name and _moves(model, data, getattr(data, field)[i], bodies[i]):
                candidates.append((int(depth[bodies[i]]), -rank, i, f"{field}.{name}"))
    if not candidates:
        raise told("nothing that moves in it has a name, so a spec can speak of no place; name a site of its last body")
    return max(candidates)[3]


def _moves(model: mujoco.MjModel, data: mujoco.MjData, point: Array, body: int) -> bool:
    """Whether a joint displaces a point of a body, at the start."""
    jacobian = np.empty((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    return bool(np.any(np.abs(jacobian) > 1e-9))


def _feedback(model: mujoco.MjModel, actuators: Sequence[str]) -> list[str]:
    """The lines of `feedback`, for the joints whose actuators have no feedback of their own."""
    gains = []
    for i, name in enumerate(actuators):
        size = float(np.ptp(model.actuator_ctrlrange[i]) / 2)
        if sets_speed(model, i):
            gains.append(f"{name}: -1")
        elif drives_one(model, i) and model.actuator_biasprm[i, 1] == 0:
            gains.append(f"{name}: [{-size:.3g}, {-size / 5:.3g}]")
    return [f"feedback: {{{', '.join(gains)}}}  # in the commands' units, per rad and rad/s"] if gains else []


def _word(name: str) -> str:
    """A name changed so that a spec can use it."""
    word = "".join(c if c.isalnum() else "_" for c in name)
    return word if word.isidentifier() else f"_{word}"


def _signal(sensor: str) -> str:
    """A signal's name for a sensor: its own, unless another signal or a word of the language has that."""
    word = _word(sensor)
    taken = word in (TIP, *STATE, COMMAND) or not is_signal_name(word)
    return f"{word}_sensor" if taken else word
