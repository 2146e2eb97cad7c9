"""check_task: silent on tasks that keep their contract, and clear on those that do not."""

import itertools

import numpy as np
import pytest

import tltlrl
from tltlrl.errors import UserError
from tltlrl.registry import TASKS
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig
from tltlrl.tasks.task import Joints, Quantity

STEPS = 9
ARM = PlanarArm(PlanarArmConfig(steps=STEPS))


def arm(**attributes):
    """A task that keeps the contract, but for what is set."""
    task = PlanarArm(PlanarArmConfig(steps=STEPS))
    for name, value in attributes.items():
        setattr(task, name, value)
    return task


def told(task):
    with pytest.raises(UserError) as error:
        tltlrl.check_task(task)
    first, *rules = str(error.value).splitlines()
    assert first == f"the task {task.name} does not keep the contract of a task:"
    return [rule.removeprefix("  ") for rule in rules]


@pytest.mark.parametrize("name", TASKS.names())
def test_every_task_keeps_the_contract_in_training_and_in_evaluation(name):
    entry = TASKS.get(name)
    for config in (entry.config(), entry.evaluation(entry.config())):
        tltlrl.check_task(entry.make(config))


ANGLES, VELOCITIES, END_EFFECTOR = PlanarArm.observation


@pytest.mark.parametrize(
    ("attributes", "rules"),
    [
        (
            {"name": "my arm"},
            ["name: 'my arm' must be one word of letters, digits and _: it names folders and columns"],
        ),
        ({"steps": 1}, ["steps: 1 must be a whole number from 2 to 100000"]),
        ({"steps": 9.0}, ["steps: 9.0 must be a whole number from 2 to 100000"]),
        ({"control_timestep": -0.05}, ["control_timestep: -0.05 must be a positive number of seconds"]),
        (
            {"observation": (ANGLES, Quantity("angles", "rad/s", VELOCITIES.parts), END_EFFECTOR)},
            [
                "observation: more than one group is named angles",
                "slices: they are named ['angles', 'end_effector'], the groups of the features "
                "['angles', 'angles', 'end_effector']",
            ],
        ),
        (
            {"observation": (ANGLES, Quantity("velocities", "rad/s", ANGLES.parts), END_EFFECTOR)},
            [f"observation: more than one part is named angle_{i}" for i in (1, 2, 3)],
        ),
        (
            {"slices": {"angles": slice(0, 3), "velocities": slice(2, 5), "end_effector": slice(6, 8)}},
            ["slices: velocities lies at 2:5, and should at 3:6"],
        ),
        ({"command_noise": np.array([0.1, -0.1, 0.1])}, ["command_noise: a standard deviation cannot be negative"]),
        ({"command_noise": 0.1}, ["command_noise: a float, where an array of float is needed"]),
        ({"command_scale": np.ones(2)}, ["command_scale: its shape is (2,), and should be (3,)"]),
        ({"command_scale": np.zeros(3)}, ["command_scale: the size of a full command must be positive"]),
        ({"feedback": np.eye(3)}, ["feedback: its shape is (3, 3), and should be (3, 8)"]),
        (
            {"steps": 0, "command_scale": np.full(3, np.inf), "feedback": np.eye(3, 8, dtype=int)},
            [
                "steps: 0 must be a whole number from 2 to 100000",
                "command_scale: not all of its numbers are finite",
                "feedback: an array of int64, where an array of float is needed",
            ],
        ),
    ],
)
def test_what_a_task_says_of_itself(attributes, rules):
    assert told(arm(**attributes)) == rules


SIGNS = itertools.cycle([1.0, -1.0])


def flipping(qpos, qvel):
    """Features that differ from call to call."""
    return next(SIGNS) * ARM.features(qpos, qvel)


def raising(*_):
    """The task's own fault."""
    raise KeyError("bread")


@pytest.mark.parametrize(
    ("attributes", "rules"),
    [
        (
            {"control_timestep": 0.06},
            [
                "make_physics: the control timestep of 0.06 s is no multiple of the model's, "
                f"{ARM.make_physics().timestep()} s; change one of them"
            ],
        ),
        (
            {
                "action": (Quantity("speeds", "rad/s", ("one", "two")),),
                "command_noise": np.ones(2),
                "command_scale": np.ones(2),
                "feedback": np.eye(2, 8),
                "reference": lambda: (ARM.reference()[0], np.zeros((STEPS, 2))),
            },
            ["make_physics: the model has 3 actuators, the task 2 commands"],
        ),
        (
            {"initial_state": lambda: (np.zeros(3), np.array([0.0, 0.0, np.nan]))},
            ["initial_state: velocities: not all of its numbers are finite"],
        ),
        (
            {"features": lambda qpos, _: qpos},
            ["features: its shape is (3, 3), and should be (3, 8)"],
        ),
        (
            {"features": lambda qpos, qvel: ARM.features(qpos, qvel) - qpos.mean()},
            ["features: those of a state depend on the other states of the batch"],
        ),
        ({"features": flipping}, ["features: asked twice of the same states, they differ"]),
        (
            {"reference": lambda: (np.zeros((STEPS, 8)), np.zeros((STEPS - 1, 3)))},
            ["reference: commands: its shape is (8, 3), and should be (9, 3)"],
        ),
        (
            {"signals": lambda features, _: {"ee": features[:, 0], "end effector": features}},
            [
                "signals: ee: its shape is (3, 8), and should be (3, 9)",
                "signals: 'end effector' cannot be named in a spec",
            ],
        ),
        (
            {"signals": lambda features, _: {"ee": np.log(0 * features)}},
            ["signals: ee: not all of its numbers are finite"],
        ),
        (
            {"signals": lambda features, _: {"jerk": features - features.mean(axis=1)[:, None]}},
            [
                "signals: jerk: its value at a sample depends on other samples, "
                "and the dm_env view has only one at a time",
            ],
        ),
        (
            {"terminated": lambda features: features[:, :1] > 0},
            ["terminated: its shape is (3, 1), and should be (3,)"],
        ),
        (
            {"terminated": lambda features: np.ones(len(features), dtype=bool)},
            ["terminated: every episode ends where it starts"],
        ),
        (
            {"outcomes": lambda qpos, _: {"done": np.ones(len(qpos))}},
            ["outcomes: done: an array of float64, where an array of bool is needed"],
        ),
        ({"outcomes": raising}, ["outcomes: it cannot be checked: KeyError: 'bread'"]),
        (
            {"joints": Joints(velocities="velocity", speeds="end_effector")},
            [
                "joints: features: no group velocity; did you mean velocities?",
                "joints: commands: no group end_effector; there are: speeds",
            ],
        ),
        (
            {"joints": Joints(velocities="end_effector")},
            ["joints: end_effector has 2 parts, angles 3"],
        ),
        ({"end_effector": "end_effect"}, ["end_effector: features: no group end_effect; did you mean end_effector?"]),
        ({"camera": "abov"}, ["camera: the model has no camera abov; did you mean above?"]),
        (
            {"skeleton": lambda features: features[..., :3]},
            ["skeleton: its shape is (9, 3), and should be (9, 3, 2)"],
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_what_its_functions_return(attributes, rules):
    """One fault may break other rules, too, so these are told among others."""
    assert [rule for rule in rules if rule not in told(arm(**attributes))] == []


def test_a_start_that_differs_from_episode_to_episode_is_told():
    starts = itertools.count()
    rules = told(arm(initial_state=lambda: (np.full(3, 1e-3 * next(starts)), np.zeros(3))))
    assert [rule.split(" by ")[0] for rule in rules] == [
        "stepping: the dm_env view is off the batched rollout",
        "repeatable: the same commands lead to other features when they are sent again",
        "repeatable: the dm_env view gives other features to the same seed",
    ]


def test_a_motion_that_cannot_be_simulated_is_told():
    rules = told(arm(initial_state=lambda: (np.zeros(3), np.full(3, 1e300))))
    assert rules[0].startswith("stepping: it cannot be checked: DivergedError: the simulation of reach_avoid")
