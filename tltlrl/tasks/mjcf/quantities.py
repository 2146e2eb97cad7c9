"""Quantities by dm_control's own names: `site_xpos.tip` is found in a model, and measured by a sensor of it.

Positions and velocities of joints are read from the state. Everything else is a sensor's value: one that the model
has (`sensordata.NAME`), or one that is added to it here, so that MuJoCo computes it in every simulation alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import mujoco

from tltlrl.errors import nearest
from tltlrl.tasks.mjcf.model import Told

Sensor, Object = mujoco.mjtSensor, mujoco.mjtObj
XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")
FORCE, NETFORCE = 1 << mujoco.mjtConDataField.mjCONDATA_FORCE.value, 3  # of a contact sensor
FAR = 100.0  # m: distances beyond are cut


@dataclass(frozen=True)
class Field:
    """The first part of a quantity's name.

    Attributes:
      of: what the second part names; two parts, for what lies between two of them.
      meaning: with the unit.
      unit: of the values.
      sensors: whose values they are, one after the other.
      kind: MuJoCo's type of the named thing.
      parts: names of the components, none for a scalar.
      order: of the sensors' values.
    """

    of: str
    meaning: str
    unit: str
    sensors: tuple[mujoco.mjtSensor, ...] = ()
    kind: mujoco.mjtObj = Object.mjOBJ_UNKNOWN
    parts: tuple[str, ...] = ()
    order: tuple[int, ...] = ()


AXES = (Sensor.mjSENS_FRAMEXAXIS, Sensor.mjSENS_FRAMEYAXIS, Sensor.mjSENS_FRAMEZAXIS)
MATRIX = tuple(f"{row}{column}" for row in "xyz" for column in "xyz")
BY_ROWS = (0, 3, 6, 1, 4, 7, 2, 5, 8)  # of a matrix given by columns


def _frame(prefix: str, of: str, kind: mujoco.mjtObj) -> dict[str, Field]:
    """What a site, body or geom has."""

    def field(what: str, unit: str, parts: tuple[str, ...], *sensors: mujoco.mjtSensor) -> Field:
        order = BY_ROWS if len(sensors) == 3 else tuple(range(len(parts)))
        return Field(of, f"{what} of a {of} in the world{', ' * bool(unit)}{unit}", unit, sensors, kind, parts, order)

    return {
        f"{prefix}xpos": field("position", "m", XYZ, Sensor.mjSENS_FRAMEPOS),
        f"{prefix}xquat": field("orientation as a quaternion", "", WXYZ, Sensor.mjSENS_FRAMEQUAT),
        f"{prefix}xmat": field("orientation as a matrix by rows", "", MATRIX, *AXES),
        f"{prefix}xaxis": field("x axis", "", XYZ, AXES[0]),
        f"{prefix}yaxis": field("y axis", "", XYZ, AXES[1]),
        f"{prefix}zaxis": field("z axis", "", XYZ, AXES[2]),
        f"{prefix}xvelp": field("velocity", "m/s", XYZ, Sensor.mjSENS_FRAMELINVEL),
        f"{prefix}xvelr": field("angular velocity", "rad/s", XYZ, Sensor.mjSENS_FRAMEANGVEL),
    }


FIELDS: Mapping[str, Field] = {
    "qpos": Field("joint", "position of a joint, rad or m", "rad or m"),
    "qvel": Field("joint", "velocity of a joint, rad/s or m/s", "rad/s or m/s"),
    **_frame("site_", "site", Object.mjOBJ_SITE),
    **_frame("", "body", Object.mjOBJ_XBODY),
    **_frame("geom_", "geom", Object.mjOBJ_GEOM),
    "subtree_com": Field(
        "body", "centre of mass of a body and what hangs on it, m", "m",
        (Sensor.mjSENS_SUBTREECOM,), Object.mjOBJ_BODY, XYZ, (0, 1, 2),
    ),
    "subtree_linvel": Field(
        "body", "velocity of that centre of mass, m/s", "m/s",
        (Sensor.mjSENS_SUBTREELINVEL,), Object.mjOBJ_BODY, XYZ, (0, 1, 2),
    ),
    "actuator_force": Field(
        "actuator", "force or torque of an actuator, N or N m", "N or N m",
        (Sensor.mjSENS_ACTUATORFRC,), Object.mjOBJ_ACTUATOR, (), (0,),
    ),
    "sensordata": Field("sensor", "a sensor of the model", "the sensor's own"),
    "distance": Field(
        "geoms", "distance between two geoms, distance.hand.lid, m; negative inside each other", "m",
        (Sensor.mjSENS_GEOMDIST,), Object.mjOBJ_GEOM, (), (0,),
    ),
    "contact_force": Field(
        "geoms", "net force of the contacts between two geoms, contact_force.hand.lid, in the world, N", "N",
        (Sensor.mjSENS_CONTACT,), Object.mjOBJ_GEOM, XYZ, (0, 1, 2),
    ),
}  # fmt: skip
NAMED = {
    "joint": Object.mjOBJ_JOINT, "site": Object.mjOBJ_SITE, "body": Object.mjOBJ_BODY, "geom": Object.mjOBJ_GEOM,
    "actuator": Object.mjOBJ_ACTUATOR, "sensor": Object.mjOBJ_SENSOR, "keyframe": Object.mjOBJ_KEY,
    "camera": Object.mjOBJ_CAMERA,
}  # fmt: skip
JOINT_PARTS = {
    mujoco.mjtJoint.mjJNT_FREE.value: (("x", "y", "z", "qw", "qx", "qy", "qz"), ("x", "y", "z", "rx", "ry", "rz")),
    mujoco.mjtJoint.mjJNT_BALL.value: (("w", "x", "y", "z"), ("x", "y", "z")),
    mujoco.mjtJoint.mjJNT_HINGE.value: ((), ()),
    mujoco.mjtJoint.mjJNT_SLIDE.value: ((), ()),
}


@dataclass(frozen=True)
class ModelQuantity:
    """A quantity found in a model.

    Attributes:
      address: as written, such as site_xpos.tip.
      field: its first part.
      names: of the joint, site, ... ; of two geoms.
      parts: names of its components, none for a scalar.
      chosen: the index of the one component that is meant, or None for all of them.
    """

    address: str
    field: str
    names: tuple[str, ...]
    parts: tuple[str, ...]
    chosen: int | None

    @property
    def whole(self) -> str:
        """The address without a component."""
        return ".".join((self.field, *self.names))

    @property
    def size(self) -> int:
        """How many numbers it is, all its components."""
        return max(len(self.parts), 1)


def names_in(model: mujoco.MjModel, of: str) -> list[str]:
    """The names of all joints, sites, ... of a model, in order; empty for what has none.

    Joints and actuators without a name have their kind and number: they are commanded and are features all the same.
    """
    kind = NAMED["geom" if of == "geoms" else of]
    counts = {
        "joint": model.njnt, "site": model.nsite, "body": model.nbody, "geom": model.ngeom, "geoms": model.ngeom,
        "actuator": model.nu, "sensor": model.nsensor, "keyframe": model.nkey, "camera": model.ncam,
    }  # fmt: skip
    numbered = of in ("joint", "actuator")
    return [mujoco.mj_id2name(model, kind.value, i) or f"{of}_{i}" * numbered for i in range(counts[of])]


def named(model: mujoco.MjModel, of: str) -> list[str]:
    """The names of all joints, sites, ... that have one."""
    return [name for name in names_in(model, of) if name]


def find(address: str, model: mujoco.MjModel, told: Told) -> ModelQuantity:
    """A quantity by its address FIELD.NAME or FIELD.NAME.COMPONENT.

    Raises:
      UserError: if there is no such field, name or component, with those that come near.
    """
    field, _, rest = address.partition(".")
    if field not in FIELDS:
        raise told(f"there is no quantity {field}{nearest(field, FIELDS)}")
    of = FIELDS[field].of
    valid = named(model, of)
    if not rest:
        raise told(f"{field} is of a {of}; write {field}.NAME{nearest('', valid)}")
    words = rest.split(".")
    for split in range(len(words), 0, -1):  # names may hold dots
        name, component = ".".join(words[:split]), words[split:]
        names = _two(name, valid) if of == "geoms" else (name,) if name in valid else None
        if names is None:
            continue
        parts = _parts(field, names, model)
        if not component:
            return ModelQuantity(address, field, names, parts, None)
        if len(component) > 1 or component[0] not in parts:
            there = nearest(component[0], parts) if parts else "; it is a single number"
            raise told(f"{'.'.join((field, *names))} has no component {'.'.join(component)}{there}")
        return ModelQuantity(address, field, names, parts, parts.index(component[0]))
    if of == "geoms":
        raise told(f"{field} is between two geoms of the model; write {field}.GEOM.GEOM{nearest(words[0], valid)}")
    raise told(f"the model has no {of} {words[0] if len(words) == 1 else rest}{nearest(words[0], valid) or none(of)}")


def none(of: str) -> str:
    """What to say where a model has none of a kind with a name."""
    return f"; it has no {of} at all"


def _two(name: str, valid: Iterable[str]) -> tuple[str, ...] | None:
    words, known = name.split("."), set(valid)
    for split in range(1, len(words)):
        pair = (".".join(words[:split]), ".".join(words[split:]))
        if known.issuperset(pair):
            return pair
    return None


def _parts(field: str, names: tuple[str, ...], model: mujoco.MjModel) -> tuple[str, ...]:
    if field in ("qpos", "qvel"):
        joint = names_in(model, "joint").index(names[0])
        return JOINT_PARTS[int(model.jnt_type[joint])][field == "qvel"]
    if field == "sensordata":
        size = int(model.sensor_dim[names_in(model, "sensor").index(names[0])])
        return () if size == 1 else {3: XYZ, 4: WXYZ}.get(size, tuple(map(str, range(size))))
    return FIELDS[field].parts


def added_name(address: str, number: int) -> str:
    """The name of a sensor that is added to a model."""
    return f"tltlrl {address} {number}"


def add_sensors(spec: mujoco.MjSpec, quantities: Iterable[ModelQuantity]) -> None:
    """Adds the sensors that measure quantities; those of the state and of the model's own sensors need none."""
    for address, quantity in {quantity.whole: quantity for quantity in quantities}.items():
        field = FIELDS[quantity.field]
        for number, sensor in enumerate(field.sensors):
            first, *second = quantity.names
            more = {"reftype": field.kind, "refname": second[0]} if second else {}
            if sensor == Sensor.mjSENS_GEOMDIST:
                more["cutoff"] = FAR
            if sensor == Sensor.mjSENS_CONTACT:
                more["intprm"] = [FORCE, NETFORCE, 1]
            spec.add_sensor(name=added_name(address, number), type=sensor, objtype=field.kind, objname=first, **more)


def sensor_places(model: mujoco.MjModel, quantity: ModelQuantity) -> list[int]:
    """Where in sensordata all components of a quantity lie, in their order."""
    field = FIELDS[quantity.field]
    count = len(field.sensors)
    sensors = [added_name(quantity.whole, i) for i in range(count)] or [quantity.names[0]]
    there = names_in(model, "sensor")
    places = [
        int(model.sensor_adr[i]) + k
        for i in (there.index(name) for name in sensors)
        for k in range(int(model.sensor_dim[i]))
    ]
    return [places[i] for i in field.order] if field.order else places
