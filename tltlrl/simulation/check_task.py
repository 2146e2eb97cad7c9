"""Checks the contract of a task; anyone can run them on their own task.

    tltlrl.check_task(TwoLink(TwoLinkConfig()))

It says nothing if the task keeps its contract. Otherwise one message names every broken rule and what is wrong. Rules
come in three groups: what the task says of itself, what its functions return, how it moves. A group is checked only if
no rule of the group before is broken.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.logic import is_signal_name
from tltlrl.simulation.outside import unlike
from tltlrl.simulation.rollout import Trajectories
from tltlrl.simulation.scene import substeps
from tltlrl.simulation.simulator import simulator_of
from tltlrl.tasks.environment import environment
from tltlrl.tasks.task import MOST_STEPS, Quantity, Task

Array = NDArray[np.float64]
Rule = Callable[[Task], Iterator[str]]  # => what is wrong; nothing if all is well

COUNT = 3  # trajectories, or states, that the checks look at
MOST_SAMPLES = 100  # stepped in one episode, so that a long one takes seconds at most
PUSH = 0.1  # of the random commands, as a share of a full one
TOLERANCE = 1e-9  # between the batched rollout and the dm_env view


def check_task(task: Task) -> None:
    """Checks that a task keeps the contract of `tltlrl.tasks.task.Task`.

    Args:
      task: any task.

    Raises:
      UserError: if it breaks a rule; it names the task, each broken rule, and what is wrong.
    """
    for stage in STAGES if getattr(task, "outside", None) is None else (STAGES[0], *OUTSIDE):
        wrong = [f"  {name}: {what}" for name, rule in stage.items() for what in _told(rule, task)]
        if wrong:
            name = getattr(task, "name", type(task).__name__)
            raise UserError("\n".join([f"the task {name} does not keep the contract of a task:", *wrong]))


def _told(rule: Rule, task: Task) -> list[str]:
    """What a rule finds wrong, including errors raised inside the task's own code."""
    try:
        return list(rule(task))
    except Exception as error:  # the task's code may raise anything
        return [f"it cannot be checked: {type(error).__name__}: {error}"]


# What the task says of itself


def _name(task: Task) -> Iterator[str]:
    if not isinstance(task.name, str) or not task.name.isidentifier():
        yield f"{task.name!r} must be one word of letters, digits and _: it names folders and columns"


def _steps(task: Task) -> Iterator[str]:
    if not isinstance(task.steps, int | np.integer) or not 2 <= task.steps <= MOST_STEPS:
        yield f"{task.steps!r} must be a whole number from 2 to {MOST_STEPS}"


def _control_timestep(task: Task) -> Iterator[str]:
    if not 0 < task.control_timestep < math.inf:
        yield f"{task.control_timestep!r} must be a positive number of seconds"


def _observation(task: Task) -> Iterator[str]:
    yield from _groups(task.observation)


def _action(task: Task) -> Iterator[str]:
    yield from _groups(task.action)


def _groups(groups: tuple[Quantity, ...]) -> Iterator[str]:
    parts = [part for group in groups for part in group.parts]
    for what, names in (("group", [group.name for group in groups]), ("part", parts)):
        for name in sorted({name for name in names if names.count(name) > 1}):
            yield f"more than one {what} is named {name}"
    for group in groups:
        if not group.parts:
            yield f"the group {group.name} has no parts"
    if not groups:
        yield "there must be at least one group"


def _slices(task: Task) -> Iterator[str]:
    names = [group.name for group in task.observation]
    if list(task.slices) != names:
        yield f"they are named {list(task.slices)}, the groups of the features {names}"
        return
    end = 0
    for group in task.observation:
        expected = slice(end, end + len(group.parts))
        end = expected.stop
        if task.slices[group.name] != expected:
            yield f"{group.name} lies at {_span(task.slices[group.name])}, and should at {_span(expected)}"


def _span(where: slice) -> str:
    return f"{where.start}:{where.stop}"


def _command_noise(task: Task) -> Iterator[str]:
    yield from _array(task.command_noise, (_commands(task),))
    if np.any(np.asarray(task.command_noise) < 0):
        yield "a standard deviation cannot be negative"


def _command_scale(task: Task) -> Iterator[str]:
    yield from _array(task.command_scale, (_commands(task),))
    if np.any(np.asarray(task.command_scale) <= 0):
        yield "the size of a full command must be positive"


def _feedback(task: Task) -> Iterator[str]:
    yield from _array(task.feedback, (_commands(task), task.width))


def _commands(task: Task) -> int:
    return sum(len(group.parts) for group in task.action)


def _array(values: object, shape: tuple[int, ...], kind: type = float) -> Iterator[str]:
    """Says so if `values` is not a finite array of the shape."""
    if not isinstance(values, np.ndarray) or values.dtype != kind:
        what = f"an array of {values.dtype}" if isinstance(values, np.ndarray) else f"a {type(values).__name__}"
        yield f"{what}, where an array of {kind.__name__} is needed"
    elif values.shape != shape:
        yield f"its shape is {values.shape}, and should be {shape}"
    elif not np.isfinite(values).all():
        yield "not all of its numbers are finite"


# What its functions return


def _make_physics(task: Task) -> Iterator[str]:
    model = task.make_physics().model.ptr
    if model.nu != _commands(task):
        yield f"the model has {model.nu} actuators, the task {_commands(task)} commands"
    try:
        substeps(task, model.opt.timestep)
    except UserError as error:
        yield str(error)


def _initial_state(task: Task) -> Iterator[str]:
    model = task.make_physics().model.ptr
    for values, size, what in zip(task.initial_state(), (model.nq, model.nv), ("positions", "velocities"), strict=True):
        yield from (f"{what}: {wrong}" for wrong in _array(values, (size,)))


def _features(task: Task) -> Iterator[str]:
    qpos, qvel = _states(task)
    features = task.features(qpos, qvel)
    wrong = list(_array(features, (COUNT, task.width - _sensed(task, qpos, qvel).shape[1])))
    yield from wrong
    if wrong:
        return
    if not np.array_equal(task.features(qpos, qvel), features):
        yield "asked twice of the same states, they differ"
    alone = np.concatenate([task.features(qpos[i : i + 1], qvel[i : i + 1]) for i in range(COUNT)])
    if not np.allclose(alone, features, rtol=0, atol=TOLERANCE):
        yield "those of a state depend on the other states of the batch"


def _sensed(task: Task, qpos: Array, qvel: Array) -> Array:
    """The features that come from sensors, at states, (COUNT, m); m is 0 for a task that has none."""
    physics, values = task.make_physics(), []
    for at in zip(qpos, qvel, strict=True):
        with physics.reset_context():
            physics.data.qpos[:], physics.data.qvel[:] = at
        values.append(np.array(physics.data.sensordata))
    return np.zeros((len(qpos), 0)) if task.sensed is None else task.sensed(np.array(values))


def _observed(task: Task) -> Array:
    """All features of the states, (COUNT, n)."""
    qpos, qvel = _states(task)
    return np.concatenate([task.features(qpos, qvel), _sensed(task, qpos, qvel)], axis=1)


def _sensed_feedback(task: Task) -> Iterator[str]:
    qpos, qvel = _states(task)
    count = _sensed(task, qpos, qvel).shape[1]
    if count and np.any(task.feedback[:, -count:]):
        yield "the feedback has gains on features of sensors, which are known after the command only"


def _start_spread(task: Task) -> Iterator[str]:
    if task.start_spread is not None:
        yield from _array(task.start_spread, (task.make_physics().model.nv,))


def _states(task: Task) -> tuple[Array, Array]:
    """States of a live physics: the start, and others around it, (COUNT, nq) and (COUNT, nv)."""
    physics, rng = task.make_physics(), np.random.default_rng(0)
    qpos, qvel = task.initial_state()
    states = []
    for size in (0.0, 0.1, 1.0):
        with physics.reset_context():
            physics.data.qpos[:], physics.data.qvel[:] = qpos, qvel
            push = size * rng.standard_normal(physics.model.nv)
            mujoco.mj_integratePos(physics.model.ptr, physics.data.qpos, push, 1.0)
            physics.data.qvel[:] += push
        states.append((np.array(physics.data.qpos), np.array(physics.data.qvel)))
    return np.array([state[0] for state in states]), np.array([state[1] for state in states])


def _reference(task: Task) -> Iterator[str]:
    shapes = ((task.steps, task.width), (task.steps, _commands(task)))
    for values, shape, what in zip(task.reference(), shapes, ("features", "commands"), strict=True):
        yield from (f"{what}: {wrong}" for wrong in _array(values, shape))


def _signals(task: Task) -> Iterator[str]:
    rng = np.random.default_rng(1)
    states = _observed(task) if task.outside is None else _motion(task).features[:, -1]
    features = states[rng.integers(COUNT, size=(COUNT, task.steps))]
    commands = task.command_scale * rng.standard_normal((COUNT, task.steps, _commands(task)))
    signals = task.signals(features, commands)
    last = task.signals(features[:1, -1:], commands[:1, -1:])
    if not signals:
        yield "there must be at least one"
    for name, values in signals.items():
        if not is_signal_name(str(name)):
            yield f"{name!r} cannot be named in a spec"
        wrong = list(_array(values, (COUNT, task.steps, *np.shape(values)[2:3])))
        yield from (f"{name}: {what}" for what in wrong)
        if not wrong and not np.allclose(last[name], values[:1, -1:], rtol=0, atol=TOLERANCE):
            yield f"{name}: its value at a sample depends on other samples, and the dm_env view has only one at a time"


def _terminated(task: Task) -> Iterator[str]:
    ended = task.terminated(_observed(task))
    wrong = list(_array(ended, (COUNT,), bool))
    yield from wrong
    if not wrong and ended[0]:
        yield "every episode ends where it starts"


def _outcomes(task: Task) -> Iterator[str]:
    for name, values in task.outcomes(*_states(task)).items():
        yield from (f"{name}: {wrong}" for wrong in _array(values, (COUNT,), bool))


def _camera(task: Task) -> Iterator[str]:
    model = task.make_physics().model
    cameras = [model.id2name(i, "camera") for i in range(model.ncam)]
    if task.camera is not None and task.camera not in cameras:
        yield f"the model has no camera {task.camera}{nearest(task.camera, cameras)}"


def _skeleton(task: Task) -> Iterator[str]:
    if task.skeleton is not None:
        points = task.skeleton(task.reference()[0])
        yield from _array(points, (task.steps, *np.shape(points)[1:2], 2))


def _joints(task: Task) -> Iterator[str]:
    if (joints := task.joints) is None:
        return
    features = {group.name: len(group.parts) for group in task.observation}
    commands = {group.name: len(group.parts) for group in task.action}
    named = ((joints.angles, features), (joints.velocities, features), (joints.speeds, commands))
    for name, groups in named:
        if name not in groups:
            yield f"{'features' if groups is features else 'commands'}: no group {name}{nearest(name, groups)}"
        elif groups[name] != features.get(joints.angles, groups[name]):
            yield f"{name} has {groups[name]} parts, {joints.angles} {features[joints.angles]}"


def _end_effector(task: Task) -> Iterator[str]:
    if task.end_effector is not None and task.end_effector not in task.slices:
        yield f"features: no group {task.end_effector}{nearest(task.end_effector, task.slices)}"


# How it moves


def _stepping(task: Task) -> Iterator[str]:
    motion = _motion(task)
    env = environment(task, noise=False)
    parts = [(part, group.unit == "rad") for group in task.observation for part in group.parts]
    angles = np.array([angle for _, angle in parts])
    for i, length in enumerate(motion.lengths):
        timestep, t = env.reset(), 0
        while True:
            difference = np.concatenate(list(timestep.observation.values())) - motion.features[i, t]
            off = np.abs(np.where(angles, (difference + np.pi) % (2 * np.pi) - np.pi, difference))  # a turn is none
            if not off.max() <= TOLERANCE:
                part, _ = parts[off.argmax()]
                yield f"the dm_env view is off the batched rollout by {off.max():.2g} in {part} at sample {t}"
                return
            t += 1
            if t == length or timestep.last():
                break
            timestep = env.step(motion.commands[i, t - 1])
        if length < motion.features.shape[1] and not timestep.last():
            yield f"the batched rollout ends an episode after {length} samples, the dm_env view does not"
            return


def _repeatable(task: Task) -> Iterator[str]:
    if not np.array_equal(_motion(task).features, _motion(task).features):
        yield "the same commands lead to other features when they are sent again"
    paths = []
    for _ in range(2):
        env = environment(task, random=0)
        env.reset()
        steps = [env.step(np.zeros(_commands(task))) for _ in range(min(task.steps, MOST_SAMPLES) - 1)]
        paths.append([np.concatenate(list(step.observation.values())) for step in steps])
    if not np.array_equal(paths[0], paths[1]):
        yield "the dm_env view gives other features to the same seed"


def _resets(task: Task) -> Iterator[str]:
    if task.outside is not None and (where := unlike(task, task.outside)) is not None:
        yield f"two resets with one seed differ in {where}"


def _motion(task: Task) -> Trajectories:
    """Random commands around those of the reference, sent to a new simulator."""
    commands = task.reference()[1][None, :MOST_SAMPLES]
    noise = np.random.default_rng(0).standard_normal((COUNT, *commands.shape[1:]))
    offsets = commands + PUSH * task.command_scale * noise
    return simulator_of(task).rollout(np.zeros_like(task.feedback), offsets, np.zeros_like(offsets))


STAGES: tuple[dict[str, Rule], ...] = (
    {
        "name": _name,
        "steps": _steps,
        "control_timestep": _control_timestep,
        "observation": _observation,
        "action": _action,
        "slices": _slices,
        "command_noise": _command_noise,
        "command_scale": _command_scale,
        "feedback": _feedback,
    },
    {
        "make_physics": _make_physics,
        "initial_state": _initial_state,
        "features": _features,
        "sensed": _sensed_feedback,
        "start_spread": _start_spread,
        "reference": _reference,
        "signals": _signals,
        "terminated": _terminated,
        "outcomes": _outcomes,
        "camera": _camera,
        "skeleton": _skeleton,
        "joints": _joints,
        "end_effector": _end_effector,
    },
    {"stepping": _stepping, "repeatable": _repeatable},
)
OUTSIDE: tuple[dict[str, Rule], ...] = (  # for a task with an outside environment, in place of the last two groups
    {"reference": _reference, "signals": _signals, "joints": _joints, "end_effector": _end_effector},
    {"repeatable": _resets},
)
