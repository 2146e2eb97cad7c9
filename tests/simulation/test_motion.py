"""Measures of motion against what they are by hand, and the settled verdict against prefixes judged one by one."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tltlrl import parse_spec
from tltlrl.simulation.motion import MEASURES, measure, path_length, settled_at, smoothness
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig
from tltlrl.training.build import first_policy
from tltlrl.training.study import AlgorithmConfig

SPECS = ["F p > 0", "G p > 0", "F G p > 0", "F (p > 0 & X p < 0)", "p < 1 U p > 2", "G (p > 0 => X G p < 0)"]


@given(st.sampled_from(SPECS), st.lists(st.integers(-3, 3), min_size=1, max_size=130))
def test_the_verdict_is_settled_where_no_later_prefix_is_violated(text, values):
    spec = parse_spec(text)
    p = np.array([values], dtype=float)
    prefixes = [spec.robustness({"p": p[:, : t + 1]})[0] > 0 for t in range(len(values))]
    expected = next((t for t in range(len(values)) if all(prefixes[t:])), None)
    assert settled_at(spec, {"p": p}) == expected


def test_lengths_accelerations_and_jerks_of_known_motions():
    t = np.arange(11) * 0.1
    assert path_length(np.column_stack([3 * t, 4 * t])) == pytest.approx(5.0)
    found = smoothness(np.column_stack([t**2, 0 * t]), 0.1)  # acceleration 2 t + 0.1, jerk 2, of one joint of two
    assert found["acceleration_peak"] == pytest.approx(1.9)
    assert found["jerk_peak"] == pytest.approx(2.0)
    assert found["jerk_rms"] == pytest.approx(np.sqrt(2.0))
    assert found["acceleration_rms"] == pytest.approx(np.sqrt(np.mean((2 * t[:-1] + 0.1) ** 2) / 2))
    assert set(smoothness(None, 0.1).values()) == {None}
    assert smoothness(np.zeros((1, 2)), 0.1)["acceleration_rms"] is None


def test_a_task_that_says_nothing_of_its_joints_has_commands_and_times_only():
    arm = PlanarArm(PlanarArmConfig(steps=8))
    simulator, spec = Simulator(arm), parse_spec("signal ee[2]\nspec: F ee.y > 0")
    policy = first_policy(arm, AlgorithmConfig())
    policy = dataclasses.replace(policy, gain=0 * policy.gain, mean=np.tile([1.0, 2.0, -3.0], (8, 1)))
    motion = mean_motion(simulator, policy)
    whole = measure(arm, simulator, spec, motion)
    assert list(whole) == list(MEASURES)
    assert whole["commands_at_limit"] == pytest.approx(2 / 3)  # of 2 rad/s
    assert whole["command_rms"] == pytest.approx(np.sqrt(14 / 12))
    assert whole["seconds_to_verdict"] == 0
    arm.joint_velocities = arm.end_effector = arm.joint_commands = None
    known = {name for name, value in measure(arm, simulator, spec, motion).items() if value is not None}
    assert known == {"command_rms", "commands_at_limit", "seconds_to_verdict"}
