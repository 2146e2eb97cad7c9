"""The batch against the environment that `dm_env` users step."""

import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.simulation import rollout
from tltlrl.simulation.rollout import Simulator, entries
from tltlrl.simulation.scene import substeps
from tltlrl.tasks.environment import environment
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig
from tltlrl.tasks.toast.scene import Toast, ToastConfig


@pytest.fixture(scope="module")
def task():
    return PlanarArm(PlanarArmConfig(steps=60, command_noise=0.0))


def feedback(task):
    return np.random.default_rng(5).normal(0, 0.3, size=(3, task.width))


def test_batch_is_the_environment_to_1e_9(task):
    rng = np.random.default_rng(0)
    offsets = rng.normal(0, 2.5, size=(4, task.steps, 3))  # beyond the limits, too
    trajectories = Simulator(task).rollout(feedback(task), offsets, np.zeros_like(offsets))
    env = environment(task)
    for n in range(4):
        timestep = env.reset()
        for t in range(task.steps):
            observed = np.concatenate(list(timestep.observation.values()))
            np.testing.assert_allclose(trajectories.features[n, t], observed, atol=1e-9, rtol=0)
            assert timestep.last() == (t == task.steps - 1)
            if not timestep.last():
                timestep = env.step(trajectories.commands[n, t])


def test_command_is_feedback_plus_offset(task):
    offsets = np.random.default_rng(1).normal(size=(3, task.steps, 3))
    gain = feedback(task)
    trajectories = Simulator(task).rollout(gain, offsets, np.zeros_like(offsets))
    np.testing.assert_allclose(trajectories.commands, trajectories.features @ gain.T + offsets, atol=1e-12)


@pytest.mark.parametrize("whose", [PlanarArm(PlanarArmConfig(steps=60)), Toast(ToastConfig(steps=40, opening_step=20))])
def test_feedback_on_the_state_alone_gives_the_bytes_of_feedback_on_all_features(whose, monkeypatch):
    """A task's own feedback is on single joints. It needs no features while the simulation goes on."""
    rng, d = np.random.default_rng(4), len(whose.command_scale)
    offsets, noise = (
        rng.normal(size=(2, 3, whose.steps, d)) * whose.command_scale * np.array([1, 0.02])[:, None, None, None]
    )
    simulator = Simulator(whose)
    monkeypatch.setattr(rollout, "ROWS", 3 * (whose.steps // 2))  # in two blocks
    asked = []
    monkeypatch.setattr(whose, "features", lambda *state, own=whose.features: asked.append(state) or own(*state))
    quick = simulator.rollout(-whose.feedback, offsets, noise)
    assert len(asked) == 2
    monkeypatch.setattr(simulator, "_entries", np.full_like(simulator._entries, -1))
    whole = simulator.rollout(-whose.feedback, offsets, noise)
    assert len(asked) == 2 + whose.steps
    for name in ("features", "commands", "lengths", "last_qpos", "last_qvel"):
        np.testing.assert_array_equal(getattr(quick, name), getattr(whole, name))


def test_a_feature_that_is_an_entry_of_the_state_is_found(task):
    assert entries(task, *task.initial_state()).tolist() == [0, 1, 2, 3, 4, 5, -1, -1]  # the end-effector is none


def test_command_noise_acts_but_is_not_recorded(task):
    offsets = np.zeros((2, task.steps, 3))
    noise = np.zeros_like(offsets)
    noise[1, 10] = 0.5
    gain = np.zeros((3, task.width))
    trajectories = Simulator(task).rollout(gain, offsets, noise)
    np.testing.assert_array_equal(trajectories.commands, 0.0)
    np.testing.assert_array_equal(trajectories.features[0, :11], trajectories.features[1, :11])
    assert np.abs(trajectories.features[1, 11, :3] - trajectories.features[0, 11, :3]).max() > 0.01


def test_trajectories_do_not_depend_on_their_neighbours(task):
    offsets = np.random.default_rng(2).normal(size=(5, task.steps, 3))
    simulator = Simulator(task)
    together = simulator.rollout(feedback(task), offsets, np.zeros_like(offsets))
    for n in range(5):
        alone = simulator.rollout(feedback(task), offsets[n : n + 1], np.zeros_like(offsets[:1]))
        np.testing.assert_allclose(alone.features[0], together.features[n], atol=1e-11)  # BLAS may sum otherwise


def test_the_callers_arrays_stay_as_they_are(task):
    offsets = np.random.default_rng(3).normal(size=(1, task.steps, 3))
    before = offsets.copy()
    Simulator(task).rollout(feedback(task), offsets, np.zeros_like(offsets))
    np.testing.assert_array_equal(offsets, before)


def test_divergence_is_told(task):
    offsets = np.zeros((2, task.steps, 3))
    offsets[1, 7] = np.nan
    with pytest.raises(FloatingPointError, match="simulation of reach_avoid diverged: trajectory 1, step 7"):
        Simulator(task).rollout(feedback(task), offsets, np.zeros_like(offsets))


class Unstable(PlanarArm):
    """Joints that are pushed the harder the faster they turn."""

    def make_physics(self):
        physics = super().make_physics()
        physics.model.dof_damping[:] = -1e6
        return physics


@pytest.mark.parametrize("kind", [PlanarArm, Unstable])
def test_a_simulation_that_goes_wrong_is_told_and_does_not_start_again(kind, capfd):
    """MuJoCo would reset it, or leave out a control that is too large, and go on with finite numbers."""
    task = kind(PlanarArmConfig(steps=60, command_noise=0.0))
    offsets = np.zeros((2, task.steps, 3))
    offsets[1, 7] = 1e14 if kind is PlanarArm else 1.0
    with pytest.raises(FloatingPointError, match="simulation of reach_avoid diverged: trajectory 1, step"):
        Simulator(task).rollout(np.zeros((3, task.width)), offsets, np.zeros_like(offsets))
    capfd.readouterr()  # MuJoCo's own warnings


def test_a_control_step_that_does_not_divide_is_told(task):
    assert substeps(task, 0.005) == 10
    assert substeps(task, 0.05 / 3) == 3
    for timestep in (0.03, 0.1, 0.0501):
        with pytest.raises(UserError, match=f"0.05 s is no multiple of the model's, {timestep} s; change one of them"):
            substeps(task, timestep)
