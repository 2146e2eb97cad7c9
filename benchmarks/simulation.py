"""Simulation and training against the raw physics engine, in ratios measured side by side."""

from __future__ import annotations

import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.engine import run_all
from tltlrl.learning.policy import Policy
from tltlrl.learning.reps import EpisodeBased, RepsSettings
from tltlrl.learning.scores import Scores
from tltlrl.tasks.environment import environment
from tltlrl.training.build import set_up
from tltlrl.training.loop import iterate
from tltlrl.training.start import first_policy as start_of
from tltlrl.training.study import Run

Row = tuple[str, float, float | None, str]  # what, measured, target if any, ">=" or "<="

ROUNDS = 7


def seconds(work: Callable[[], object]) -> float:
    """Wall-clock time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def median_ratio(a: Callable[[], object], b: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Median of time(a) / time(b) over alternating rounds, after a warm-up."""
    a(), b()
    return statistics.median(seconds(a) / seconds(b) for _ in range(rounds))


def make_run(name: str) -> Run:
    """The first run of an experiment."""
    return read(compose([f"experiment={name}"]))[0].runs()[0]


def closed_loop(count: int = 20) -> list[Row]:
    """The batched closed loop against raw mj_step, and against stepping the task's dm_env environment."""
    run = make_run("reach_avoid")
    setup = set_up(run)
    task, simulator, policy = setup.task, setup.simulator, start_of(setup.task, run.algorithm)
    rng = np.random.default_rng(0)
    offsets, noise = policy.sample(count, rng), simulator.draw_command_noise(count, rng)
    physics = task.make_physics()
    substeps = round(task.control_timestep / physics.timestep())
    model, data = physics.model.ptr, physics.data.ptr

    def batch() -> None:
        simulator.rollout(policy.gain, offsets, noise)

    def raw() -> None:
        mujoco.mj_step(model, data, count * (task.steps - 1) * substeps)

    alone, kind = mujoco.rollout.Rollout(nthread=0), mujoco.mjtState.mjSTATE_FULLPHYSICS.value
    start = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, start, kind)
    starts, control = np.tile(start, (count, 1)), np.zeros((count, substeps, model.nu))
    states, sensed = np.empty((count, substeps, start.size)), np.empty((count, substeps, model.nsensordata))
    models = [model] * count

    def calls() -> None:  # the calls into C that the closed loop makes, one per control step, and nothing else
        for _ in range(task.steps - 1):
            alone.rollout(
                models, [data], starts, control, nstep=substeps, skip_checks=True, state=states, sensordata=sensed
            )

    env = environment(task)

    def loop() -> None:  # one trajectory, as a user of dm_env writes it
        timestep = env.reset()
        for offset in offsets[0, :-1]:
            observed = np.concatenate([timestep.observation[key] for key in timestep.observation])
            timestep = env.step(policy.gain @ observed + offset)

    return [
        (f"closed loop, N = {count}: rate / raw mj_step rate", 1 / median_ratio(batch, raw), 0.75, ">="),
        ("its mujoco.rollout calls alone: rate / raw mj_step rate", 1 / median_ratio(calls, raw), None, ""),
        (f"closed loop, N = {count}: rate / dm_env loop rate", count * median_ratio(loop, batch), 12, ">="),
    ]


def iteration(name: str) -> Row:
    """One whole training iteration against its physics alone."""
    run = make_run(name)
    setup = set_up(run)
    state = setup.learner.start(start_of(setup.task, run.algorithm))
    ratios = []
    for i in range(2 * ROUNDS):
        start = time.perf_counter()
        result = iterate(run, setup, state, i)
        ratios.append((time.perf_counter() - start) / result.physics_seconds)
        state = result.state
    return f"{name}: whole iteration / its physics", statistics.median(ratios[2:]), 1.15, "<="


def update() -> Row:
    """Sampling and one update on the 60-dimensional quadratic, 30 samples."""
    learner = EpisodeBased(RepsSettings(), 30)
    rng = np.random.default_rng(0)
    optimum = rng.standard_normal((20, 3))
    state = learner.start(Policy(np.zeros((3, 1)), np.zeros((20, 3)), np.tile(np.eye(3), (20, 1, 1))))
    times = []
    for _ in range(200):
        start = time.perf_counter()
        offsets = learner.ask(state, 30, rng)
        state, _ = learner.tell(state, offsets, Scores(-np.sum((offsets - optimum) ** 2, axis=(1, 2))))
        times.append(time.perf_counter() - start)
    return "REPS, 60 dimensions, 30 samples: ms per update", 1e3 * statistics.median(times), 0.5, "<="


def raw_rate(processes: int, steps: int = 400_000) -> float:
    """Steps per second of that many processes, all in mj_step from the start to the end of the clock."""
    physics = set_up(make_run("reach_avoid")).task.make_physics()
    model, data = physics.model.ptr, physics.data.ptr
    context = multiprocessing.get_context("fork")
    ready = context.Barrier(processes + 1)

    def work() -> None:
        mujoco.mj_step(model, data, steps // 20)
        ready.wait()
        mujoco.mj_step(model, data, steps)

    workers = [context.Process(target=work) for _ in range(processes)]
    for worker in workers:
        worker.start()
    ready.wait()
    return processes * steps / seconds(lambda: [worker.join() for worker in workers])


def experiment_rate(workers: int, count: int = 24) -> float:
    """Runs per second of an experiment of equal runs, from when every worker has finished its first one.

    Before that they import MuJoCo, which is start-up and not throughput.
    """
    settings = ["experiment=reach_avoid", "cases=[tltl_episodic]", "algorithm.iterations=25", "trials=1"]
    runs = read(compose([*settings, f"seeds={count + workers}"]))[0].runs()
    first: set[int] = set(range(workers))  # one for each worker
    ends: list[float] = []

    def on_end(index: int, error: Exception | None, _: str) -> None:
        assert error is None
        first.discard(index)
        if not first:
            ends.append(time.perf_counter())

    with tempfile.TemporaryDirectory() as folder:
        run_all([(run, Path(folder) / str(run.seed)) for run in runs], workers, None, lambda *_: None, on_end, print)
    return (len(ends) - 1) / (ends[-1] - ends[0])


def two_workers(rounds: int = 5) -> list[Row]:
    """Throughput of two workers over one, beside what two raw mj_step processes reach over one in the same minute."""
    possible, shares = [], []
    for _ in range(rounds):
        possible.append(raw_rate(2) / raw_rate(1))
        shares.append(experiment_rate(2) / experiment_rate(1) / possible[-1])
    return [
        ("two raw mj_step processes / one, throughput", statistics.median(possible), None, ""),
        ("two workers / one, throughput, as a share of that", statistics.median(shares), 0.9, ">="),
    ]


def rows() -> list[Row]:
    """Every row of this module."""
    return [*closed_loop(), iteration("reach_avoid"), iteration("visit_in_order"), update(), *two_workers()]
