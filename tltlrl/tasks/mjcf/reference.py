"""docs/robot-yaml.md, made from the tables of keys and of quantities: `python -m tltlrl.tasks.mjcf.reference`."""

from __future__ import annotations

from tltlrl.tasks.mjcf.keys import COMMON, KINDS, RobotConfig
from tltlrl.tasks.mjcf.quantities import FIELDS

HEAD = """\
# The page of a robot

A page is a YAML file with these keys; only `model` has to be there. [Bring your robot](bring-your-robot.md) shows how
to write one. (This page is made from the code: `python -m tltlrl.tasks.mjcf.reference > docs/robot-yaml.md`.)
"""
KEYS = """
Each key can be changed for one experiment, as in `task.duration=3`. `evaluation` may hold all keys but {fixed}.

## Signals

A signal stands for one quantity, or for a list of them, one after the other; a single number is a scalar, more are a
vector. A quantity is FIELD.NAME, with the name that the thing has in the MJCF file, or FIELD.NAME.COMPONENT for one
of its numbers. The signal `command`, what the policy sends, is always there.

| quantity | what it is | components |
|---|---|---|
"""
TAIL = """
Positions and velocities of joints are read from the state. Everything else is a sensor of the model, or becomes one
when the model is compiled, so that MuJoCo computes it in the same way in training and in the `dm_env` view. Forces and
accelerations (`contact_force`, `actuator_force`, sensors such as `touch` and `accelerometer`) at a sample are those
of the physics step that led to it.
"""


def reference() -> str:
    """The text of the page."""
    default = RobotConfig()
    lines = [HEAD, "| key | what it means | default | for instance |", "|---|---|---|---|"]
    for key, kind in KINDS.items():
        value = getattr(default, key)
        shown = "" if value in ("", None, [], {}) else f"`{value}`"
        lines.append(f"| `{key}` | {kind.meaning} | {shown} | `{key}: {kind.example}` |")
    lines.append(KEYS.format(fixed=", ".join(f"`{key}`" for key in COMMON)).rstrip("\n"))
    for name, field in FIELDS.items():
        of = "GEOM.GEOM" if field.of == "geoms" else field.of.upper()
        parts = ", ".join(field.parts) or ("those of the joint" if field.of == "joint" else "")
        lines.append(f"| `{name}.{of}` | {field.meaning} | {parts} |")
    return "\n".join(lines) + "\n" + TAIL


if __name__ == "__main__":
    print(reference(), end="")
