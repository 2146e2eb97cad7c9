"""Films: what stands below the pictures, several side by side, and the files; nothing is rendered here."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from PIL import Image

from tltlrl.errors import UserError
from tltlrl.logic import parse_spec
from tltlrl.registry import TASKS
from tltlrl.reports.video import (
    AMBIENT,
    INSIDE_COLOUR,
    OUTSIDE_COLOUR,
    WIDTH,
    Film,
    _frame,
    _told,
    beside,
    film_strip,
    look_at_all,
    write_film,
)
from tltlrl.tasks.environment import environment


def frames(count, height=40, width=WIDTH):
    return [np.full((height, width, 3), 20 * i, dtype=np.uint8) for i in range(count)]


def test_below_a_picture_the_square_of_a_clause_is_full_where_it_holds_so_far():
    low, high = (_told("a", 0.5, {"G safe": np.array([-1.0, 2.0])}, step) for step in (0, 1))
    assert low.shape == high.shape
    assert low.shape[1] == WIDTH
    changed = np.argwhere((low != high).any(axis=2) & (np.arange(WIDTH) < 20))
    assert len(changed) > 40
    assert high[tuple(changed[len(changed) // 2])].max() == 0
    assert low[tuple(changed[len(changed) // 2])].min() == 255


def test_side_by_side_the_shorter_one_keeps_its_last_picture():
    both = beside([Film(frames(2), 0.05), Film(frames(3, height=50), 0.05)])
    assert [frame.shape for frame in both.frames] == [(50, 2 * WIDTH, 3)] * 3
    assert [frame[0, 0, 0] for frame in both.frames] == [0, 20, 20]
    assert both.frames[0][49, 0, 0] == 255
    with pytest.raises(UserError, match="runs of one task"):
        beside([Film(frames(2), 0.05), Film(frames(2), 0.1)])


def test_the_files_of_a_film(tmp_path):
    files = write_film(Film(frames(8, width=64), 0.05), tmp_path / "motion_0.3")
    assert {path.name for path in files} >= {"motion_0.3.gif", "motion_0.3.png"}
    with Image.open(tmp_path / "motion_0.3.gif") as gif:
        assert (gif.n_frames, gif.info["duration"]) == (8, 50)
    if (mp4 := tmp_path / "motion_0.3.mp4") in files:
        assert mp4.read_bytes()[4:8] == b"ftyp"
        assert b"avc1" in mp4.read_bytes()  # H.264


def test_the_time_in_a_strip_is_read_on_black_and_on_white():
    for shade in (0, 255):
        strip = film_strip([np.full((60, WIDTH, 3), shade, dtype=np.uint8)] * 8, 0.05)
        assert {0, 255} <= {grey for _, grey in strip.convert("L").getcolors()}


def test_without_a_camera_a_whole_motion_and_its_places_are_seen():
    task = TASKS.get("reach_avoid").make(TASKS.get("reach_avoid").config())
    env = environment(task, noise=False)
    (far,) = parse_spec("signal ee[3]\nspec: F distance(ee, (5, 0, 1)) < 0.5").regions
    commands, stat = np.full((60, 3), 0.5), env.physics.model.stat
    look_at_all(env, commands, [far])
    low, high = stat.center - stat.extent / 2, stat.center + stat.extent / 2
    assert high[0] >= 5.5
    env.reset()
    tips = [env.step(command).observation["end_effector"] for command in commands]
    assert np.min(tips, axis=0)[0] < -1
    assert (np.min(tips, axis=0) > low[:2]).all()
    assert (np.max(tips, axis=0) < high[:2]).all()


def test_in_grey_too_a_region_to_keep_out_of_is_darker():
    def grey(colour, white=1.0):
        return float(np.array([0.299, 0.587, 0.114]) @ (colour[3] * colour[:3] + (1 - colour[3]) * white))

    assert grey(OUTSIDE_COLOUR) < grey(INSIDE_COLOUR) - 0.1


@pytest.mark.parametrize(("light", "bright"), [("", True), ("<light/>", False)])
def test_a_model_without_a_light_gets_one(light, bright):
    text = f"<mujoco><worldbody>{light}<geom size='1'/></worldbody></mujoco>"
    physics = SimpleNamespace(model=mujoco.MjModel.from_xml_string(text), render=lambda *_, **__: np.zeros((2, 2, 3)))
    _frame(physics, None, [])
    assert (physics.model.vis.headlight.ambient[0] == np.float32(AMBIENT)) == bright


@pytest.mark.parametrize(("sky", "walls"), [("", 1), ("<texture type='skybox' builtin='flat' width='8'/>", 0)])
def test_a_model_without_a_sky_has_a_white_wall_behind_it(sky, walls):
    """Farther away than the model, and within what the camera sees."""
    text = f"<mujoco><asset>{sky}</asset><worldbody><geom size='1'/></worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    scene = mujoco.MjvScene(model, maxgeom=5)
    eye = scene.camera[0]
    eye.pos, eye.forward, eye.up, eye.frustum_far = (0, -5, 0), (0, 1, 0), (0, 0, 1), 100

    def render(*_, scene_callback, **__):
        scene_callback(None, scene)
        return np.zeros((2, 2, 3))

    _frame(SimpleNamespace(model=model, render=render), None, [])
    assert scene.ngeom == walls
    if walls:
        assert scene.geoms[0].pos.tolist() == [0, 85, 0]
        assert scene.geoms[0].mat[:, 2].tolist() == [0, 1, 0]
        assert scene.geoms[0].rgba.tolist() == [1, 1, 1, 1]
