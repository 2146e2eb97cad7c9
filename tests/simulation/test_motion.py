"""Measures of motion against sums written out, and the moment from which on a motion satisfies its spec."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tltlrl.logic import parse_spec
from tltlrl.simulation.motion import MEASURES, effort, measures, path_length, satisfied_from, smoothness
from tltlrl.simulation.rollout import Trajectories
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig

NUMBERS = st.floats(-100, 100, allow_subnormal=False)
LIMITS = (np.array([-2.0, -2.0]), np.array([2.0, np.inf]))


@given(arrays(float, st.tuples(st.integers(3, 9), st.integers(1, 3)), elements=NUMBERS), st.sampled_from([0.05, 0.5]))
def test_smoothness_is_that_of_the_differences(velocities, timestep):
    steps, joints = velocities.shape
    a = [[(velocities[t + 1][j] - velocities[t][j]) / timestep for j in range(joints)] for t in range(steps - 1)]
    b = [[(a[t + 1][j] - a[t][j]) / timestep for j in range(joints)] for t in range(steps - 2)]
    found = smoothness(velocities, timestep)
    for name, rows in (("acceleration", a), ("jerk", b)):
        every = [value for row in rows for value in row]
        assert found[f"{name}_rms"] == pytest.approx((sum(x * x for x in every) / len(every)) ** 0.5, abs=1e-9)
        assert found[f"{name}_peak"] == pytest.approx(max(map(abs, every)), abs=1e-9)


def test_a_motion_of_two_samples_has_no_jerk_and_one_of_a_single_sample_nothing():
    assert smoothness(np.array([[0.0], [1.0]]), 0.5) == {
        "acceleration_rms": 2.0, "acceleration_peak": 2.0, "jerk_rms": None, "jerk_peak": None,
    }  # fmt: skip
    assert set(smoothness(np.zeros((1, 3)), 0.5).values()) == {None}
    assert effort(np.zeros((0, 2)), np.ones(2), *LIMITS) == {"command_rms": None, "commands_at_limit": None}


def test_path_length_is_that_of_the_polyline():
    assert path_length(np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 3.0]])) == 6.0


def test_commands_count_as_shares_of_full_ones_and_at_a_limit_from_both_sides():
    commands = np.array([[2.0, 8.0], [-2.5, -2.0], [1.0, 1e6], [0.0, 0.0]])
    found = effort(commands[[0, 1, 3]], np.array([2.0, 4.0]), *LIMITS)
    assert found["command_rms"] == pytest.approx(np.sqrt((1 + 4 + 1.25**2 + 0.25 + 0 + 0) / 6))
    assert found["commands_at_limit"] == pytest.approx(3 / 6)
    assert effort(commands[2:3], np.ones(2), *LIMITS)["commands_at_limit"] == 0.0  # no limit, however much


@given(st.lists(st.integers(-2, 2), min_size=1, max_size=200), st.sampled_from(["F x > 0", "G x > 0", "F G x > 0"]))
def test_satisfied_from_there_on_every_prefix_satisfies_and_the_one_before_does_not(values, text):
    spec, length = parse_spec(f"signal x\nspec: {text}"), len(values)
    signals = {"x": np.array([[*map(float, values), 1.0]])}  # the last sample lies after the end
    satisfied = [spec.robustness({"x": signals["x"][:, :n]})[0] > 0 for n in range(1, length + 1)]
    expected = next((t for t in range(length) if all(satisfied[t:])), None)
    assert satisfied_from(spec, signals, length) == expected


def test_what_a_task_does_not_name_is_not_measured_and_what_follows_an_end_does_not_count():
    task = PlanarArm(PlanarArmConfig(steps=6))
    features = np.zeros((1, 6, task.width))
    features[0, :4, task.slices["end_effector"]] = [[0, 0], [0, 1], [0, 2], [0, 3]]
    features[0, 4:] = 1e9
    motion = Trajectories(features, np.ones((1, 6, 3)), np.array([4]), np.zeros((1, 3)), np.zeros((1, 3)))
    spec = parse_spec("signal ee[2]\nspec: F ee.y > 1.5")
    found = measures(task, spec, motion, (np.full(3, -2.0), np.full(3, 2.0)))
    assert list(found) == list(MEASURES)
    assert found["path_length"] == 3.0
    assert found["acceleration_rms"] == 0.0
    assert found["command_rms"] == 0.5
    assert found["time_to_satisfaction"] == pytest.approx(0.1)
    task.joints = task.end_effector = None
    known = ("command_rms", "commands_at_limit", "time_to_satisfaction")  # of all commands
    only_these = {name: value for name, value in found.items() if name in known}
    found = measures(task, spec, motion, (np.full(3, -2.0), np.full(3, 2.0)))
    assert {name: value for name, value in found.items() if value is not None} == only_these
