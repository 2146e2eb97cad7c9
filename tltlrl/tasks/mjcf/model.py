"""Finds and digests the MJCF file of a robot, lets MuJoCo read it, and reports what is wrong in it."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from pathlib import Path

import mujoco
from lxml import etree

from tltlrl.errors import UserError, nearest
from tltlrl.store.files import digest_of_digests
from tltlrl.tasks.mjcf.keys import RobotConfig
from tltlrl.tasks.mjcf.page import Key, mistake, shown

Told = Callable[[str], UserError]  # what is wrong => the error that says where


def model_path(model: str, folder: Path, told: Told) -> Path:
    """The path of a model's file, from a path relative to a folder or from package:path.

    Args:
      model: the model as the page gives it.
      folder: folder of the page.
      told: makes the error for the page's key.

    Raises:
      UserError: if there is no such file.
    """
    package, colon, inside = model.partition(":")
    if not colon:
        path = folder / Path(model).expanduser()
        there = [entry.name for entry in folder.glob("*.xml")] if folder.is_dir() else []
        if not path.is_file():
            raise told(f"there is no file {model} in {shown(folder)}{nearest(model, there)}")
        return path.resolve()
    if not package.isidentifier():
        raise told(f"{package} is no package's name; write package:path, as dm_control:suite/reacher.xml")
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise told(f"there is no package {package} installed; install it, or give the path of a file")
    path = Path(found.submodule_search_locations[0]) / inside
    if not path.is_file():
        there = [str(entry.relative_to(path.parent)) for entry in path.parent.glob("*.xml")]
        raise told(f"the package {package} has no file {inside}{nearest(path.name, there)}")
    return path.resolve()


def digest_of(path: Path) -> str:
    """SHA-256 of a model's file and all files that it names: other models, meshes, textures, height fields."""
    return digest_of_digests(("", file) for file in _files(path))


def page_digest(config: RobotConfig) -> str:
    """The digest of all files of the model, and of the model for evaluation."""
    folder = Path(config.file).parent
    path = model_path(config.model, folder, lambda what: mistake(config, ("model",), what))
    paths = [path]
    if "model" in config.evaluation:
        there: Key = ("evaluation", "model")
        paths.append(model_path(config.evaluation["model"], folder, lambda what: mistake(config, there, what)))
    return "-".join(digest_of(path)[:32] for path in paths)


def _files(path: Path) -> list[Path]:
    """The model's files, in the order in which they are named."""
    found: dict[Path, None] = {}
    folders = [path.parent]

    def visit(file: Path) -> None:
        if file in found or not file.is_file():
            return
        found[file] = None
        if file.suffix.lower() not in (".xml", ".mjcf"):
            return
        try:
            root = etree.fromstring(file.read_bytes())
        except etree.XMLSyntaxError:  # MuJoCo will say so
            return
        for element in root.iter("compiler"):
            folders.extend(
                path.parent / element.get(name) for name in ("assetdir", "meshdir", "texturedir") if element.get(name)
            )
        named = [value for element in root.iter() for key, value in element.attrib.items() if key.startswith("file")]
        for name in named:
            for folder in dict.fromkeys(folders):
                visit((folder / name).resolve())

    visit(path)
    return list(found)


def read_model(path: Path) -> mujoco.MjSpec:
    """Reads a model, which may still be changed; automatic resets are switched off.

    Joints and actuators without a name are named by their kind and number: they are commanded, measured and features
    all the same, and keep these names when others are taken out.

    Raises:
      UserError: if MuJoCo cannot read it; with MuJoCo's message and its line.
    """
    try:
        spec = mujoco.MjSpec.from_file(str(path))  # a copy of a spec would lose what refers to nothing
    except ValueError as error:
        raise complaint(path, error) from None
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    for kind, elements in (("joint", spec.joints), ("actuator", spec.actuators)):
        taken = {element.name for element in elements}
        for i, element in enumerate(elements):
            if not element.name and f"{kind}_{i}" not in taken:
                element.name = f"{kind}_{i}"
    return spec


def compiled(path: Path, spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compiles a model, ready to be simulated.

    Raises:
      UserError: if MuJoCo cannot compile it; with MuJoCo's message and its line.
    """
    try:
        return spec.compile()
    except ValueError as error:
        raise complaint(path, error) from None


def complaint(path: Path, error: Exception) -> UserError:
    """The error for what MuJoCo finds wrong with a model, on one line."""
    text = " ".join(str(error).split())
    line = re.search(r"[Ll]ine(?: number)?[ =](\d+)", text)
    text = re.sub(r"^(XML Error: |Error: |XML parse error \d+: )", "", text)
    text = re.sub(r",? ?[Ll]ine(?: number)?[ =]\d+:?", "", text)
    text = re.sub(r"Error=(\w+) ErrorID=\d+ \(0x\w+\)", r"\1", text)
    where = f"{shown(path)}:{line[1]}" if line else shown(path)
    return UserError(f"{where}: MuJoCo cannot read the model: {text}; correct the MJCF file")
