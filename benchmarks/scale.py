"""Hundreds of runs: planning, queueing, summarising and plotting, on finished runs of full length that are made up."""

from __future__ import annotations

import os
import pickle
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

from benchmarks.simulation import Row, seconds
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.results import finished, run_folder, survey
from tltlrl.learning.policy import Policy
from tltlrl.reports.plotting import plot_learning_curves, titled
from tltlrl.reports.report import write_report
from tltlrl.reports.sealed import read_curves
from tltlrl.store.layout import PROGRESS
from tltlrl.store.run import write_results
from tltlrl.training.build import make_task
from tltlrl.training.session import arrays_of
from tltlrl.training.study import Run, Study

COLUMNS = (
    "task,case,reward,algorithm,seed,iteration,episodes,env_steps,return_mean,robustness_mean,robustness_std,"
    "robustness_min,robustness_max,robustness_policy,satisfied_fraction,eta,kl,effective_sample_size,entropy"
)
TASKS = ("reach_avoid", "visit_in_order", "toast")
ITERATIONS, SEEDS = 500, 20


def plan(task: str) -> Study:
    """A study of every case of a task on 20 seeds."""
    return read(compose([f"experiment={task}", f"seeds={SEEDS}", f"algorithm.iterations={ITERATIONS}"]))[0]


def make_up(run: Run, folder: Path) -> None:
    """The files of a finished run with curves of random numbers, as long as those of a real one."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng([run.seed, len(run.case.name)])
    start = f"{run.task.name},{run.case.name},{run.case.reward},{run.case.learner},{run.seed}"
    numbers = np.linspace(-1, 0.2, ITERATIONS)[:, None] + 0.1 * rng.standard_normal((ITERATIONS, 11))
    samples = run.algorithm.samples
    counts = [f"{start},{i},{(i + 1) * samples},{(i + 1) * samples * run.task.steps}" for i in range(ITERATIONS)]
    rows = [f"{counts[i]},{','.join(map(str, numbers[i].tolist()))}" for i in range(ITERATIONS)]
    (folder / PROGRESS).write_text("\n".join([COLUMNS, *rows]) + "\n")
    features, commands = make_task(run.task).reference()
    steps, d = commands.shape
    policy = Policy(np.zeros((d, features.shape[1])), commands, np.tile(np.eye(d), (steps, 1, 1)))
    successes = int(rng.integers(0, run.trials + 1))
    results = {"iterations": ITERATIONS, "robustness_policy": numbers[-1, 5], "satisfied": bool(numbers[-1, 5] > 0),
               "trials": run.trials, "successes": successes, "outcomes": {}, "why_policy_fails": [],
               "why_trials_fail": []}  # fmt: skip
    write_results(folder, run.identity(), arrays_of(policy), results)


def summarise(folder: Path, experiments: list[Study]) -> tuple[float, float]:
    """Seconds and peak memory above that of before (MB) to summarise and plot experiments in a process of their own."""
    ours, its = os.pipe()
    pid = os.fork()
    if pid == 0:
        peak = Path("/proc/self/status")
        Path("/proc/self/clear_refs").write_text("5")  # the peak starts here
        before = psutil.Process().memory_info().rss
        start = time.perf_counter()
        for experiment in experiments:
            path = folder / experiment.name
            assert not survey(path, experiment)[0]
            write_report(path, experiment, finished(path, experiment), {})
        taken = time.perf_counter() - start
        (line,) = (line for line in peak.read_text().splitlines() if line.startswith("VmHWM"))
        os.write(its, f"{taken} {(int(line.split()[1]) * 1024 - before) / 1e6}".encode())
        os._exit(0)
    os.waitpid(pid, 0)
    taken, memory = os.read(ours, 100).split()
    return float(taken), float(memory)


def draw(folders: list[Path], path: Path) -> None:
    """As `tltl plot` does."""
    plot_learning_curves(titled(folders, [read_curves(folder)[0] for folder in folders]), path)


def rows() -> list[Row]:
    """Every row of this module."""
    start = time.perf_counter()
    experiments = [plan(task) for task in TASKS]
    planning = time.perf_counter() - start
    runs = [run for experiment in experiments for run in experiment.runs()]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for experiment in experiments:
            for run in experiment.runs():
                make_up(run, run_folder(folder / experiment.name, run))
        taken, memory = summarise(folder, experiments)
        paths = [folder / experiment.name for experiment in experiments]
        plotting = seconds(
            lambda: plot_learning_curves(titled(paths, [read_curves(p)[0] for p in paths]), folder / "all")
        )
    size = max(len(pickle.dumps(run)) for run in runs)
    what = f"{len(runs)} runs of {ITERATIONS} iterations"
    return [
        (f"seconds to plan {len(runs)} runs in {len(TASKS)} experiments", planning, 2, "<="),
        ("kB to queue one run", size / 1e3, 10, "<="),
        (f"seconds to summarise and plot {what}", taken, 10, "<="),
        (f"peak memory to summarise and plot {what}, MB", memory, 300, "<="),
        (f"seconds to plot {what} again in one figure", plotting, 5, "<="),
    ]
