"""Trials off the model: what is changed, by how much, and what is told."""

import mujoco
import numpy as np
import pytest

from tltlrl.errors import UserError
from tltlrl.learning.policy import Policy
from tltlrl.simulation.perturb import Perturbation, perturbation_of, perturbed_trials
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.simulator import simulator_of
from tltlrl.simulation.trials import trials
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig

TASK = PlanarArm(PlanarArmConfig(steps=8))
POLICY = Policy(
    TASK.feedback, np.tile(0.3 * TASK.command_scale, (8, 1)), np.tile(np.eye(len(TASK.command_scale)), (8, 1, 1)), 0.0
)


def tried(size, **ranges):
    whole, diverged = perturbed_trials(TASK, POLICY, Perturbation(**ranges), size, 3, np.random.default_rng(0))
    assert diverged == 0
    return whole


def test_a_trial_that_diverges_is_counted_and_the_others_go_on(monkeypatch):
    rollout, calls = Simulator.rollout, []

    def diverges(self, *arguments):
        calls.append(arguments)
        if len(calls) % 3 == 1:
            raise FloatingPointError("the simulation diverged")
        return rollout(self, *arguments)

    plain = tried(1.0, start=0.1)
    monkeypatch.setattr(Simulator, "rollout", diverges)
    arguments = (TASK, POLICY, Perturbation(start=0.1), 1.0)
    whole, diverged = perturbed_trials(*arguments, 3, np.random.default_rng(0))
    assert diverged == 1
    np.testing.assert_array_equal(whole.features, plain.features[1:])
    assert perturbed_trials(*arguments, 1, np.random.default_rng(0)) == (None, 1)


def test_at_size_0_trials_are_those_of_the_model():
    whole = tried(0.0, mass=(0.5, 2.0), damping=(0.5, 2.0), start=0.3)
    np.testing.assert_array_equal(whole.features[:, 0], tried(0.0).features[:, 0])
    first = trials(simulator_of(TASK), POLICY, 1, np.random.default_rng(0))
    np.testing.assert_allclose(whole.features[0], first.features[0], rtol=0, atol=1e-12)


def test_a_range_of_one_number_is_the_model_changed_by_that_factor(monkeypatch):
    """Beside a task whose model was changed before it was compiled into a simulator."""
    heavier = tried(0.5, mass=(3.0, 3.0), damping=(1.5, 1.5))  # half of it: twice the masses, 1.25 of the damping
    own = PlanarArm.make_physics

    def changed(task):
        physics = own(task)
        model = physics.model.ptr
        model.body_mass[:] *= 2
        model.body_inertia[:] *= 2
        model.dof_damping[:] *= 1.25
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return physics

    plain = tried(1.0)
    monkeypatch.setattr(PlanarArm, "make_physics", changed)
    expected = tried(1.0)
    np.testing.assert_allclose(heavier.features, expected.features, rtol=0, atol=1e-9)
    assert np.abs(heavier.features - plain.features).max() > 1e-6


def test_starts_are_off_by_their_spread_and_the_same_trials_at_every_size():
    half, whole = tried(0.5, start=0.1), tried(1.0, start=0.1)
    angles = TASK.slices["angles"]
    plain = tried(1.0).features[:, 0, angles]
    np.testing.assert_allclose(2 * (half.features[:, 0, angles] - plain), whole.features[:, 0, angles] - plain)
    assert np.all(whole.features[:, 0, angles] != plain)


def test_what_is_written_is_what_is_meant():
    assert perturbation_of("mass=0.8:1.2, start=.02") == Perturbation(mass=(0.8, 1.2), start=0.02)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mas=0.8:1.2", "--perturb mas=0.8:1.2: expected one of mass, friction, damping, start; did you mean mass?"),
        ("mass=1:2,mass=1:3", "--perturb mass=1:3: expected one of mass, friction, damping, start; it stands there"),
        ("mass=0.8", "--perturb mass=0.8: expected mass=0.8:1.2"),
        ("start=a", "--perturb start=a: expected start=0.02"),
        ("friction=2:1", "--perturb friction=2:1: expected numbers up to 1000, the lower first"),
        ("mass=0:1", "--perturb mass=0:1: expected numbers up to 1000, the lower first, and no mass of 0"),
        ("start=1e9", "--perturb start=1e9: expected start=0.02"),
    ],
)
def test_mistakes_are_told(text, message):
    with pytest.raises(UserError) as error:
        perturbation_of(text)
    assert str(error.value).startswith(message)
