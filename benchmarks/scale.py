"""Hundreds of runs: planning, queueing, summarising and plotting, on finished runs of full length that are made up."""

from __future__ import annotations

import csv
import dataclasses
import os
import pickle
import shutil
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

from benchmarks.simulation import Row, seconds
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.results import finished, run_folder, survey
from tltlrl.reports.plotting import plot_learning_curves, titled
from tltlrl.reports.report import write_report
from tltlrl.reports.sealed import read_curves
from tltlrl.store.layout import CLAUSES, PROGRESS
from tltlrl.store.run import read_policy, read_results, write_results
from tltlrl.training.session import train
from tltlrl.training.study import Run, Study

TASKS = ("reach_avoid", "visit_in_order", "toast")
ITERATIONS, SEEDS = 500, 20


def plan(task: str) -> Study:
    """A study of every case of a task on 20 seeds."""
    size = [f"seeds={SEEDS}", f"algorithm.iterations={ITERATIONS}", "trials=1"]
    return read(compose([f"experiment={task}", *size]))[0]


def stretched(real: Path, made: Path, rng: np.random.Generator, **same: object) -> None:
    """A CSV file of a run made as long as ITERATIONS, with random numbers in place of the measured ones."""
    (row,) = csv.DictReader(real.read_text().splitlines())
    counts = {name: int(row[name]) for name in ("episodes", "env_steps") if name in row}
    measured = [name for name in row if "." in row[name]]
    with open(made, "w", newline="") as file:
        writer = csv.DictWriter(file, row, lineterminator="\n")
        writer.writeheader()
        for i in range(ITERATIONS):
            numbers = np.linspace(-1, 0.2, ITERATIONS)[i] + 0.1 * rng.standard_normal(len(measured))
            counted = {"iteration": i} | {name: (i + 1) * value for name, value in counts.items()}
            writer.writerow(row | dict(zip(measured, numbers.tolist(), strict=True)) | counted | same)


def make_up(run: Run, folder: Path, real: Path) -> None:
    """The files of a finished run with curves of random numbers, as long as those of a real one.

    Args:
      run: what is made up.
      folder: its folder, which is made.
      real: the folder of a run of the same case, trained for one iteration.
    """
    folder.mkdir(parents=True)
    rng = np.random.default_rng([run.seed, len(run.case.name)])
    stretched(real / PROGRESS, folder / PROGRESS, rng, seed=run.seed)
    stretched(real / CLAUSES, folder / CLAUSES, rng)
    results = read_results(real)
    assert results is not None
    write_results(folder, run.identity(), read_policy(real), results | {"iterations": ITERATIONS})


def make_up_all(study: Study, folder: Path) -> None:
    """Makes up every run of a study from one short real run of each case."""
    one = dataclasses.replace(study.algorithm, iterations=1)
    first = {run.case: run for run in reversed(study.runs())}
    for case, run in first.items():
        (real := folder / "real" / case.name).mkdir(parents=True)
        train(dataclasses.replace(run, algorithm=one), real, lambda _: None)
    for run in study.runs():
        make_up(run, run_folder(folder / study.name, run), folder / "real" / run.case.name)
    shutil.rmtree(folder / "real")


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
            make_up_all(experiment, folder)
        taken, memory = summarise(folder, experiments)
        paths = [folder / experiment.name for experiment in experiments]
        plotting = seconds(lambda: draw(paths, folder / "all"))
    size = max(len(pickle.dumps(run)) for run in runs)
    what = f"{len(runs)} runs of {ITERATIONS} iterations"
    return [
        (f"seconds to plan {len(runs)} runs in {len(TASKS)} experiments", planning, 2, "<="),
        ("kB to queue one run", size / 1e3, 10, "<="),
        (f"seconds to summarise and plot {what}", taken, 10, "<="),
        (f"peak memory to summarise and plot {what}, MB", memory, 300, "<="),
        (f"seconds to plot {what} again in one figure", plotting, 5, "<="),
    ]
