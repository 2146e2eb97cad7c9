"""The learned motion as MuJoCo sees it: a film and a strip of frames, rendered without a display."""

from __future__ import annotations

import io
import itertools
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from dm_control.mujoco.wrapper import MjvOption
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tltlrl.errors import UserError
from tltlrl.learning.policy import Policy
from tltlrl.logic import Region, Spec
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.store.files import write_bytes
from tltlrl.tasks.environment import environment
from tltlrl.tasks.task import Task
from tltlrl.training.build import make_evaluation_task
from tltlrl.training.study import Run

Frame = NDArray[np.uint8]

HEIGHT, WIDTH = 360, 480  # pixels
STRIP_ROWS, STRIP_COLUMNS = 2, 3
INSIDE_COLOUR = np.array([0.3, 0.5, 0.9, 0.18], dtype=np.float32)
OUTSIDE_COLOUR = np.array([0.9, 0.4, 0.2, 0.25], dtype=np.float32)  # of what `distance(...) > radius` keeps out of
CLEARANCE = 0.004  # m, around a region, whose faces would else coincide with those of the body it stands for
DISC_HEIGHT = 0.01  # m, of a region in the plane


def render_motion(run: Run, policy: Policy, path: Path) -> None:
    """Writes path.gif, the motion of the noise-free mean policy at its own speed, and path.png, six frames of it.

    Args:
      run: what was learned.
      policy: learned by the run.
      path: without suffix.

    Raises:
      UserError: if no renderer is to be had on this machine.
    """
    task = make_evaluation_task(run.task)
    frames = motion_frames(task, run.spec, policy)
    pictures = [Image.fromarray(frame).quantize(128) for frame in frames]
    film = io.BytesIO()
    pictures[0].save(
        film,
        format="GIF",
        save_all=True,
        append_images=pictures[1:],
        duration=1000 * task.control_timestep,
        loop=0,
    )
    write_bytes(path.with_suffix(".gif"), film.getvalue())
    _save(film_strip(frames, task.control_timestep), path.with_suffix(".png"))


def render_start(task: Task, path: Path) -> None:
    """The scene at the start with the world's axes: x red, y green, z blue.

    Args:
      task: of which scene.
      path: of a .png file.

    Raises:
      UserError: if no renderer is to be had on this machine.
    """
    env = environment(task, noise=False)
    env.reset()
    option = MjvOption()
    option.frame = mujoco.mjtFrame.mjFRAME_WORLD.value
    _save(Image.fromarray(_frame(env.physics, task.camera, [], option)), path)


def _save(picture: Image.Image, path: Path) -> None:
    """A .png file, whole or not at all."""
    content = io.BytesIO()
    picture.save(content, format="PNG")
    write_bytes(path, content.getvalue())


def film_strip(frames: list[Frame], timestep: float) -> Image.Image:
    """Six frames in reading order, each with its time, evenly spread over how much the picture changes.

    Args:
      frames: of the film.
      timestep: between two of them, s.
    """
    strip = Image.new("RGB", (STRIP_COLUMNS * WIDTH, STRIP_ROWS * HEIGHT))
    draw = ImageDraw.Draw(strip)
    font = ImageFont.load_default(size=HEIGHT // 15)
    changes = [np.abs(np.subtract(a, b, dtype=float)).mean() for a, b in itertools.pairwise(frames)]
    seen = np.concatenate([[0.0], np.cumsum(changes)])
    chosen = np.searchsorted(seen, np.linspace(0, seen[-1], STRIP_ROWS * STRIP_COLUMNS))
    for place, i in enumerate(chosen):
        row, column = divmod(place, STRIP_COLUMNS)
        corner = (column * WIDTH, row * HEIGHT)
        strip.paste(Image.fromarray(frames[i]), corner)
        draw.text((corner[0] + 10, corner[1] + 8), f"{i * timestep:.2f} s", fill="black", font=font)
    return strip


def motion_frames(task: Task, spec: Spec, policy: Policy) -> list[Frame]:
    """One picture per sample, (HEIGHT, WIDTH, 3): the environment stepped with the mean policy's commands."""
    places = [region for region in spec.regions if region.signal == "ee" or task.units.get(region.signal or "") == "m"]
    commands = mean_motion(Simulator(task), policy).commands[0]
    env = environment(task, noise=False)
    frames, timestep = [], env.reset()
    for command in commands:
        frames.append(_frame(env.physics, task.camera, places))
        if timestep.last():
            break
        timestep = env.step(command)
    return frames


def _frame(physics: Any, camera: str | None, places: list[Region], option: Any = None) -> Frame:
    def draw_regions(_: object, scene: mujoco.MjvScene) -> None:
        for region in places:
            if scene.ngeom == scene.maxgeom or len(region.centre or region.lower or ()) not in (2, 3):
                continue
            if region.centre is not None:
                centre, size = np.array(region.centre), np.full(3, region.radius)
                shape = mujoco.mjtGeom.mjGEOM_SPHERE
            else:
                lower, upper = np.array(region.lower), np.array(region.upper)
                centre, size = (lower + upper) / 2, (upper - lower) / 2
                shape = mujoco.mjtGeom.mjGEOM_BOX
            if len(centre) == 2:  # a disc or rectangle in the plane
                centre, size = np.append(centre, 0.0), np.append(size[:2], DISC_HEIGHT)
                if shape == mujoco.mjtGeom.mjGEOM_SPHERE:
                    shape, size = mujoco.mjtGeom.mjGEOM_CYLINDER, np.array([size[0], size[0], DISC_HEIGHT])
            scene.ngeom += 1
            mujoco.mjv_initGeom(
                scene.geoms[scene.ngeom - 1],
                shape,
                size + CLEARANCE,
                centre.astype(float),
                np.eye(3).ravel(),
                INSIDE_COLOUR if region.inside else OUTSIDE_COLOUR,
            )

    try:
        view = -1 if camera is None else camera
        return np.array(physics.render(HEIGHT, WIDTH, camera_id=view, scene_option=option, scene_callback=draw_regions))
    except (RuntimeError, ImportError, mujoco.FatalError) as error:
        raise UserError(
            f"no picture can be rendered on this machine ({error}); install a software renderer (Debian: "
            f"libegl1 libgl1-mesa-dri, or libosmesa6) and set MUJOCO_GL=egl or MUJOCO_GL=osmesa. "
            f"Training, evaluation and curves need none."
        ) from error
