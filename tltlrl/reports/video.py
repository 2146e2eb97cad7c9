"""Renders the learned motion with MuJoCo, as a film and a strip of frames; it needs no display."""

from __future__ import annotations

import importlib.util
import io
import itertools
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dm_env
import mujoco
import numpy as np
from dm_control.mujoco.wrapper import MjvOption
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tltlrl.errors import UserError
from tltlrl.learning.policy import Policy
from tltlrl.logic import Region, Spec
from tltlrl.reports.motion import watch
from tltlrl.simulation.simulator import simulator_of
from tltlrl.simulation.trials import mean_motion
from tltlrl.store.files import write_bytes
from tltlrl.tasks.environment import environment
from tltlrl.tasks.task import Outside, Task
from tltlrl.training.build import make_evaluation_task
from tltlrl.training.study import Run

Array = NDArray[np.float64]
Frame = NDArray[np.uint8]

HEIGHT, WIDTH = 360, 480  # pixels
LINE, EDGE = 18, 6  # pixels: of a line of text below, and around the text
LONGEST, MOST_CLAUSES = 48, 8  # characters of a clause; clauses
STRIP_FRAMES = 6  # in two rows, or more where frames are wider
# Of regions to be in, and of those that `distance(...) > radius` keeps out of, which are darker, in grey, too.
INSIDE_COLOUR = np.array([0.3, 0.5, 0.9, 0.18], dtype=np.float32)
OUTSIDE_COLOUR = np.array([0.7, 0.2, 0.05, 0.32], dtype=np.float32)
CLEARANCE = 0.004  # m, around a region, whose faces would else coincide with those of the body it stands for
AMBIENT, DIFFUSE = 0.35, 0.55  # light on a model that has none of its own
WHITE = np.ones(4, dtype=np.float32)
DISC_HEIGHT = 0.01  # m, of a region in the plane


@dataclass(frozen=True)
class Film:
    """A motion as pictures.

    Attributes:
      frames: one picture per sample, (H, W, 3).
      timestep: time between two frames, s.
    """

    frames: list[Frame]
    timestep: float


def film(run: Run, policy: Policy, name: str) -> Film:
    """The noise-free motion of a policy, with its name, the time and each clause so far below every picture.

    Args:
      run: what was learned.
      policy: of the run's task.
      name: of the policy.

    Raises:
      UserError: if no renderer is to be had on this machine.
    """
    task = make_evaluation_task(run.task)
    frames = motion_frames(task, run.spec, policy)
    motion = watch(task, run.spec, policy, simulator_of(task))
    clauses = {text: watched.now for text, watched in list(motion.clauses.items())[:MOST_CLAUSES]}
    told = [_told(name, i * task.control_timestep, clauses, i) for i in range(len(frames))]
    return Film([np.concatenate(pair) for pair in zip(frames, told, strict=True)], task.control_timestep)


def beside(films: Sequence[Film]) -> Film:
    """Joins several films side by side, each from its start; a shorter one keeps its last picture.

    Raises:
      UserError: if their timesteps differ.
    """
    if len({each.timestep for each in films}) > 1:
        raise UserError("these runs have different times between two samples; render runs of one task side by side")
    length, height = max(len(each.frames) for each in films), max(each.frames[0].shape[0] for each in films)
    rows = [
        [np.pad(frame, ((0, height - len(frame)), (0, 0), (0, 0)), constant_values=255) for frame in each.frames]
        for each in films
    ]
    return Film(
        [np.concatenate([row[min(i, len(row) - 1)] for row in rows], axis=1) for i in range(length)], films[0].timestep
    )


def write_film(shown: Film, path: Path) -> list[Path]:
    """Writes path.gif, path.png (six frames) and, if the extra `video` is installed, path.mp4 (H.264).

    Args:
      shown: the film.
      path: without suffix.

    Returns:
      The files.
    """
    gif, mp4, strip = (path.with_name(path.name + suffix) for suffix in (".gif", ".mp4", ".png"))
    pictures = [Image.fromarray(frame).quantize(128) for frame in shown.frames]
    animation = io.BytesIO()
    pictures[0].save(
        animation, format="GIF", save_all=True, append_images=pictures[1:], duration=1000 * shown.timestep, loop=0
    )
    write_bytes(gif, animation.getvalue())
    _save(film_strip(shown.frames, shown.timestep), strip)
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        return [gif, strip]
    import imageio_ffmpeg

    height, width, _ = shown.frames[0].shape
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder) / "film.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(own), (width, height), fps=1 / shown.timestep, codec="libx264", macro_block_size=2, quality=7
        )
        writer.send(None)
        for frame in shown.frames:
            writer.send(np.ascontiguousarray(frame))
        writer.close()
        write_bytes(mp4, own.read_bytes())
    return [mp4, gif, strip]


def _told(name: str, time: float, clauses: Mapping[str, Array], step: int) -> Frame:
    """The text below a picture, as an image (H, WIDTH, 3)."""
    picture = Image.new("RGB", (WIDTH, LINE * (len(clauses) + 1) + 2 * EDGE), "white")
    draw, font = ImageDraw.Draw(picture), ImageFont.load_default(size=LINE - 4)
    draw.text((EDGE, EDGE), name, fill="black", font=font)
    draw.text((WIDTH - EDGE, EDGE), f"{time:.2f} s", fill="black", font=font, anchor="ra")
    for row, (text, now) in enumerate(clauses.items(), start=1):
        value = now[min(step, len(now) - 1)]
        y = EDGE + row * LINE
        draw.rectangle((EDGE, y + 3, EDGE + 9, y + 12), outline="black", fill="black" if value > 0 else "white")
        shown = text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
        draw.text((EDGE + 16, y), shown, fill="black", font=font)
        draw.text((WIDTH - EDGE, y), f"{value:+.3f}", fill="black", font=font, anchor="ra")
    return np.array(picture)


def render_start(task: Task, path: Path) -> None:
    """Renders the scene at the start with the world's axes (x red, y green, z blue), or an environment's own picture.

    Args:
      task: of which scene.
      path: of a .png file.

    Raises:
      UserError: if no renderer is to be had on this machine.
    """
    if task.outside is not None:
        own = task.outside.make(True)
        own.reset(task.outside.seed or 0)
        _save(Image.fromarray(own.picture(HEIGHT, WIDTH)), path)
        return
    env = environment(task, noise=False)
    env.reset()
    option = MjvOption()
    option.frame = mujoco.mjtFrame.mjFRAME_WORLD.value
    _save(Image.fromarray(_frame(env.physics, task.camera, [], option)), path)


def _save(picture: Image.Image, path: Path) -> None:
    """Writes a .png file, whole or not at all."""
    content = io.BytesIO()
    picture.save(content, format="PNG")
    write_bytes(path, content.getvalue())


def film_strip(frames: list[Frame], timestep: float) -> Image.Image:
    """Six frames in reading order, each with its time, evenly spread over how much the picture changes.

    Args:
      frames: frames of the film.
      timestep: time between two frames, s.
    """
    height, width, _ = frames[0].shape
    columns = max(STRIP_FRAMES // 2 * WIDTH // width, 1)
    strip = Image.new("RGB", (columns * width, -(-STRIP_FRAMES // columns) * height))
    draw = ImageDraw.Draw(strip)
    font = ImageFont.load_default(size=HEIGHT // 15)
    changes = [np.abs(np.subtract(a, b, dtype=float)).mean() for a, b in itertools.pairwise(frames)]
    seen = np.concatenate([[0.0], np.cumsum(changes)])
    chosen = np.searchsorted(seen, np.linspace(0, seen[-1], STRIP_FRAMES))
    for place, i in enumerate(chosen):
        row, column = divmod(place, columns)
        corner = (column * width, row * height)
        strip.paste(Image.fromarray(frames[i]), corner)
        at, time = (corner[0] + 10, corner[1] + 8), f"{i * timestep:.2f} s"
        draw.text(at, time, fill="black", font=font, stroke_width=3, stroke_fill="white")  # to be read on black, too
    return strip


def motion_frames(task: Task, spec: Spec, policy: Policy) -> list[Frame]:
    """One picture per sample, (HEIGHT, WIDTH, 3): the environment stepped with the mean policy's commands."""
    if task.outside is not None:
        return _own_frames(task, task.outside, policy)
    places = [region for region in spec.regions if region.signal == "ee" or task.units.get(region.signal or "") == "m"]
    commands = mean_motion(simulator_of(task), policy).commands[0]
    env = environment(task, noise=False)
    if task.camera is None:
        look_at_all(env, commands, places)
    frames, timestep = [], env.reset()
    for command in commands:
        frames.append(_frame(env.physics, task.camera, places))
        if timestep.last():
            break
        timestep = env.step(command)
    return frames


def look_at_all(env: dm_env.Environment, commands: Array, places: Sequence[Region]) -> None:
    """Moves the free camera, which looks at the start, so far back that it sees a whole motion, and all places.

    Args:
      env: of a task, with its `physics`.
      commands: of the motion, shape (T, d).
      places: regions of the spec.
    """
    model = env.physics.model
    moving = model.body_weldid[model.geom_bodyid] != 0
    timestep, centres, sizes = env.reset(), [], []
    for command in commands:
        centres.append(env.physics.data.geom_xpos[moving].copy())
        sizes.append(model.geom_rbound[moving, None])
        if timestep.last():
            break
        timestep = env.step(command)
    for region in places:
        if region.centre is not None and len(region.centre) == 3:
            centres.append(np.array([region.centre]))
            sizes.append(np.array([[region.radius]]))
    around, size = np.concatenate(centres), np.concatenate(sizes)
    if len(around):
        low, high = (around - size).min(axis=0), (around + size).max(axis=0)
        model.stat.center[:], model.stat.extent = (low + high) / 2, (high - low).max()


def _own_frames(task: Task, outside: Outside, policy: Policy) -> list[Frame]:
    """The pictures that the environment has of itself along the mean motion."""
    motion = mean_motion(simulator_of(task), policy)
    env = outside.make(True)
    env.reset(outside.seed or 0)
    frames = [env.picture(HEIGHT, WIDTH)]
    for command in motion.commands[0, : motion.lengths[0] - 1]:
        env.step(np.clip(command, *outside.command_range))
        frames.append(env.picture(HEIGHT, WIDTH))
    return frames


def _draw_wall(scene: mujoco.MjvScene) -> None:
    """Adds a white wall to a scene, almost as far behind it as the camera sees, across the whole picture."""
    eye = scene.camera[0]
    ahead, up = (np.array(axis, dtype=float) for axis in (eye.forward, eye.up))
    away = 0.9 * eye.frustum_far
    axes = np.stack([np.cross(ahead, up), up, ahead], axis=1)
    scene.ngeom += 1
    wall = scene.geoms[scene.ngeom - 1]
    size, centre = np.array([away * 10, away * 10, away / 1000]), np.array(eye.pos) + away * ahead
    mujoco.mjv_initGeom(wall, mujoco.mjtGeom.mjGEOM_BOX, size, centre, axes.ravel(), WHITE)
    wall.category, wall.emission = mujoco.mjtCatBit.mjCAT_DECOR, 1.0  # as white in any light


def _frame(physics: Any, camera: str | None, places: list[Region], option: Any = None) -> Frame:
    def draw_regions(_: object, scene: mujoco.MjvScene) -> None:
        no_sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX not in physics.model.tex_type  # and so a black background
        if no_sky and scene.ngeom < scene.maxgeom:
            _draw_wall(scene)
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

    if physics.model.nlight == 0:  # MuJoCo's own light, which goes with the camera, is dim
        light = physics.model.vis.headlight
        light.ambient[:], light.diffuse[:] = AMBIENT, DIFFUSE
    try:
        view = -1 if camera is None else camera
        return np.array(physics.render(HEIGHT, WIDTH, camera_id=view, scene_option=option, scene_callback=draw_regions))
    except (RuntimeError, ImportError, mujoco.FatalError) as error:
        raise UserError(
            f"no picture can be rendered on this machine ({error}); install a software renderer (Debian: "
            f"libegl1 libgl1-mesa-dri, or libosmesa6) and set MUJOCO_GL=egl or MUJOCO_GL=osmesa. "
            f"Training, evaluation and curves need none."
        ) from error
