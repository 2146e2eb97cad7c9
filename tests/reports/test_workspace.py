"""Pictures of a learned motion: of any task that has a point to follow, with labels beside what they name."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tltlrl.learning.policy import Policy
from tltlrl.logic import Region, parse_spec
from tltlrl.reports import strips, workspace
from tltlrl.reports.labels import Label, place
from tltlrl.reports.motion import entries, watch, watch_clauses
from tltlrl.simulation.rollout import Simulator
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig

POLICY = Policy(np.zeros((3, 8)), np.full((10, 3), 0.4), np.tile(np.eye(3), (10, 1, 1)))
IN_PLACE = "signal ee[2]\ndef start: distance(ee, (1.5, 2.3)) < 0.1\nspec: F start & G !start"


SLOT = "signal tip[3]\ndef slot: box(tip, (0.67, -0.38, 0.03), (0.72, -0.32, 0.08))"


def run_of(spec, task):
    return SimpleNamespace(
        task=task.config,
        seed=0,
        algorithm=SimpleNamespace(iterations=1),
        spec=parse_spec(spec),
        case=SimpleNamespace(name="tltl_episodic"),
    )


@pytest.fixture
def task(monkeypatch):
    own = PlanarArm(PlanarArmConfig(steps=10))
    for module in (workspace, strips):
        monkeypatch.setattr(module, "make_task", lambda _: own)
    return own


def test_a_task_needs_no_signal_of_a_certain_name(tmp_path, task):
    task.signals = lambda features, _: {"turn": features[..., 0]}
    run = run_of("signal turn\nspec: G turn > 0", task)
    assert workspace.can_draw(run)
    pictures = []
    for name in ("first", "again"):
        workspace.draw_workspace(run, POLICY, tmp_path / name / "workspace", count=2)
        pictures.append({path.suffix: path.read_bytes() for path in (tmp_path / name).iterdir()})
    assert pictures[0].keys() == {".png", ".pdf"}
    assert pictures[0] == pictures[1]


def test_of_a_point_in_space_there_are_two_views(task):
    plane = task.signals
    task.signals = lambda features, commands: {
        "tip": np.insert(plane(features, commands)["ee"], 2, features[..., 0], axis=-1)
    }
    box = "signal tip[3]\ndef at: box(tip, (1.4, 2.2, -9), (1.6, 2.4, 9))\nspec: F at"
    figure = workspace.workspace_figure(run_of(box, task), POLICY, count=2)
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in figure.axes[:2]]
    assert labels == [("x (m)", "y (m)"), ("x (m)", "z (m)")]


def test_labels_of_two_views_are_whole_and_free(task):
    """Of a narrow motion, whose numbers are long: -0.35."""
    task.skeleton = None
    way = np.array([0.6, -0.62, -0.1]) + np.linspace(0, 1, 10)[:, None] * [0.1, 0.27, 0.2]
    task.signals = lambda features, _: {"tip": np.broadcast_to(way, (len(features), *way.shape))}
    figure = workspace.workspace_figure(run_of(f"{SLOT}\nspec: F slot", task), POLICY, count=2)
    FigureCanvasAgg(figure).draw()
    first, second = figure.axes[:2]
    for axes in (first, second):
        assert max(len(tick.get_text()) for tick in axes.get_yticklabels()) >= 5
    left, between = (axes.yaxis.label.get_window_extent().x0 for axes in (first, second))
    assert left > 0
    assert between > first.get_window_extent().x1


def test_regions_say_when_they_are_entered_and_the_ring_what_decides(task):
    task.signals = lambda features, _: {"ee": features[..., task.slices["end_effector"]]}
    figure = workspace.workspace_figure(run_of(IN_PLACE, task), POLICY, count=2)
    assert [text.get_text() for text in figure.axes[0].texts] == ["start\n0 s", "decides, 0 s"]


def test_labels_leave_start_end_and_entries_free(task):
    spec = run_of(IN_PLACE, task).spec
    motion = watch(task, spec, POLICY, Simulator(task))
    labels = workspace._labels(motion, (0, 1))
    (entry,) = entries(spec.regions[0], motion.path)
    free = {label.at for label in labels if not label.text}
    assert free >= {tuple(motion.path[step]) for step in (0, entry, -1)}
    axes = Figure().add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(-3, 3), ylim=(-3, 3))
    for mark in ((0.0, -0.5), (0.0, 0.5)):  # below, where a label would be, and above
        (box,) = place(axes, [Label("at", (0.0, 0.0), 0.3), Label("", mark)], np.zeros((1, 2)))
        assert not box.contains(*axes.transData.transform(mark))


def test_clauses_while_the_motion_runs_end_as_those_of_the_whole_motion(task):
    spec = run_of(IN_PLACE, task).spec
    motion = watch(task, spec, POLICY, Simulator(task))
    whole = spec.clauses({"ee": motion.path[None]})
    assert {text: each.now[-1] for text, each in motion.clauses.items()} == {t: v[0] for t, v in whole.items()}
    for each in motion.clauses.values():
        assert np.all((each.lower <= each.now) & (each.now <= each.upper))
        assert np.all((each.lower <= each.now[-1]) & (each.now[-1] <= each.upper))
    assert motion.why.step == spec.explain({"ee": motion.path[None]})[0].step


def test_over_time_every_clause_has_a_strip(task):
    figure = strips.strips_figure(run_of(IN_PLACE, task), POLICY)
    titles = [axes.get_title(loc="left") for axes in figure.axes[strips.STRETCHES + 1 :]]
    assert [title.partition(":")[0] for title in titles] == ["F start", "G !start"]


def test_an_entry_is_the_first_sample_inside():
    path = np.array([[0.0, 0], [2, 0], [0.5, 0], [0.1, 0], [3, 0], [0, 0]])
    ball = Region("a", "ball", "ee", True, centre=(0.0, 0.0), radius=1.0)
    box = Region("b", "box", "ee", True, lower=(1.0, -1.0), upper=(4.0, 1.0))
    assert entries(ball, path) == [0, 2, 5]
    assert entries(box, path) == [1, 4]


def test_labels_are_on_no_other_label_or_region_and_nearest_to_their_own():
    axes = Figure().add_axes((0.1, 0.1, 0.8, 0.8))
    axes.set(xlim=(-3, 3), ylim=(-3, 3))
    labels = [Label(f"at[{i}]\n1.2 s", (0.5 * i, 0.3 * i), 0.2) for i in range(-3, 4)]
    boxes = place(axes, labels, np.zeros((1, 2)))
    centres = axes.transData.transform([label.at for label in labels])
    reach = axes.transData.transform((0.2, 0))[0] - axes.transData.transform((0, 0))[0]
    for i, box in enumerate(boxes):
        middle, half = np.array([box.x0 + box.x1, box.y0 + box.y1]) / 2, np.array([box.width, box.height]) / 2
        gaps = np.linalg.norm(np.maximum(np.abs(centres - middle) - half, 0), axis=1) - reach
        assert not any(box.overlaps(other) for other in boxes[:i])
        assert gaps.argmin() == i
        assert np.delete(gaps, i).min() > 0


def test_a_spec_that_cannot_be_monitored_has_no_clauses_over_time():
    spec = parse_spec("signal x\nspec: F[0,2 s] x > 0")
    assert watch_clauses(spec, {"x": np.zeros((1, 3))}) == {}
