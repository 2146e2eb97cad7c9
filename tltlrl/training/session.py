"""Takes one run from where it stands to its end: resume, iterate, checkpoint, judge."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from tltlrl.errors import UserError
from tltlrl.learning.learner import Learner
from tltlrl.learning.policy import Policy
from tltlrl.store.files import clear_leftovers, digest, naming
from tltlrl.store.layout import CLAUSES, DONE, LAST, PROGRESS, TIMING
from tltlrl.store.lock import BusyError, held
from tltlrl.store.run import (
    Checkpoint,
    DamagedError,
    iterations_done,
    read_calm_checkpoint,
    read_checkpoint,
    read_results,
    shelve_checkpoint,
    write_calm_checkpoint,
    write_checkpoint,
    write_results,
)
from tltlrl.training.build import Setup, make_learner, make_task, set_up
from tltlrl.training.calm import Calm, begin, calm_policy, simplified
from tltlrl.training.learned import check_policy, learned_policy
from tltlrl.training.loop import iterate
from tltlrl.training.start import first_policy, refined_policy
from tltlrl.training.states import Stand, arrays_of, from_arrays, resume
from tltlrl.training.study import Run
from tltlrl.training.verdict import judge, robustness_of

CHECKPOINT_SECONDS = 2.0
LOCK_SECONDS = 10.0  # a worker ends within a few seconds after its command was killed


def train(run: Run, folder: Path, report: Callable[[int], None]) -> None:
    """Finishes a run: writes progress.csv, clauses.csv, timing.csv, policy.npz and, last, done.json.

    Args:
      run: what to do.
      folder: folder of the run; a stopped run is resumed from the checkpoint there.
      report: called with the number of finished iterations, and later of iterations and calm batches together.

    Raises:
      ValueError: if a return is not a number, or a learner's diagnostics change; the folder keeps what was done.
      UserError: if another process, such as a remote worker that outlived its command, still computes this run.
    """
    try:
        with held(folder, LOCK_SECONDS):
            clear_leftovers(folder)
            with contextlib.suppress(DamagedError):
                if read_results(folder, run.identity()) is not None:
                    check_policy(make_task(run.task), learned_policy(folder))
                    shelve_checkpoint(folder)
                    return
            if shorter := shorter_run(run, folder):
                _go_on(shorter, run, folder)
            (folder / DONE).unlink(missing_ok=True)
            _train(run, folder, report)
    except BusyError as error:
        raise UserError(f"{folder}: another process still computes this run; stop it, and start again") from error


def shorter_run(run: Run, folder: Path) -> Run | None:
    """The same run with fewer iterations, if the folder holds its complete results; otherwise None."""
    done = iterations_done(folder)
    if done is None or not 0 < done < run.algorithm.iterations:
        return None
    shorter = dataclasses.replace(run, algorithm=dataclasses.replace(run.algorithm, iterations=done))
    try:
        return shorter if read_results(folder, shorter.identity()) is not None else None
    except DamagedError:
        return None


def _go_on(shorter: Run, run: Run, folder: Path) -> None:
    """Makes the last state of a finished run the checkpoint of the same run with more iterations.

    What an iteration draws depends only on the seed and its number, so the run ends in the same bytes as without a
    stop. Results of old versions hold no last state. Then the run starts again, and ends in the same bytes too.
    """
    with contextlib.suppress(DamagedError):
        if (saved := read_checkpoint(folder, shorter.identity(), LAST)) is not None:
            write_checkpoint(folder, run.identity(), saved)


def _train(run: Run, folder: Path, report: Callable[[int], None]) -> None:
    setup, identity = set_up(run), run.identity()
    start = first_policy(setup.task, run.algorithm)

    def learner_after(iterations: int) -> Learner[Any]:
        return make_learner(run, run.stage(max(iterations - 1, 0)))

    def like(iterations: int) -> Stand:
        return Stand(learner_after(iterations).start(start), start, -math.inf)

    first, env_steps, stand = resume(folder, identity, like)
    setup = dataclasses.replace(setup, learner=learner_after(first))
    same = {
        "task": setup.task.name,
        "case": run.case.name,
        "reward": run.case.reward,
        "algorithm": run.case.learner,
        "seed": run.seed,
    }
    columns = (folder / PROGRESS).read_text(encoding="utf-8").split("\n", 1)[0].split(",") if first else None
    last_checkpoint = time.monotonic()
    with (
        naming(folder / PROGRESS),
        open(folder / PROGRESS, "a", newline="", encoding="utf-8") as progress,
        open(folder / CLAUSES, "a", newline="", encoding="utf-8") as clauses,
        open(folder / TIMING, "a", newline="", encoding="utf-8") as timing,
    ):
        for i in range(first, run.algorithm.iterations):
            clock = time.perf_counter()
            if run.refine is not None and i == run.refine.first:
                refined = refined_policy(
                    setup.task, setup.simulator, setup.learner.policy(stand.state), run.refine.algorithm
                )
                setup = dataclasses.replace(setup, learner=make_learner(run, run.refine))
                stand = dataclasses.replace(stand, state=setup.learner.start(refined))
            result = iterate(run, setup, stand.state, i)
            stand = stand.seen(setup.learner.policy(stand.state), result.record["robustness_policy"])
            stand = dataclasses.replace(stand, state=result.state)
            env_steps += result.env_steps
            counts = {"iteration": i, "episodes": (i + 1) * run.algorithm.samples, "env_steps": env_steps}
            row = same | counts | result.record
            if run.algorithm.keep == "best":
                row["robustness_kept"] = stand.robustness
            columns = columns or list(row)
            if list(row) != columns:  # otherwise values would stand under wrong names
                raise ValueError(f"the learner's diagnostics changed at iteration {i}: {list(row)}, before {columns}")
            _write_row(progress, row, header=i == 0)
            _write_row(clauses, {"iteration": i} | result.clauses, header=i == 0)
            took = {"iteration": i, "seconds": time.perf_counter() - clock, "physics_seconds": result.physics_seconds}
            _write_row(timing, took, header=i == 0)
            report(i + 1)
            if time.monotonic() - last_checkpoint > CHECKPOINT_SECONDS:
                for file in (progress, clauses, timing):
                    file.flush()
                write_checkpoint(folder, identity, Checkpoint(i + 1, env_steps, arrays_of(stand)))
                last_checkpoint = time.monotonic()
    write_checkpoint(folder, identity, Checkpoint(run.algorithm.iterations, env_steps, arrays_of(stand)))
    policy = setup.learner.policy(stand.state)
    if run.algorithm.keep == "best":
        policy = stand.seen(policy, robustness_of(run, setup, policy)).best
    results = judge(run, setup, policy)
    calm = None
    if run.algorithm.calm and results["satisfied"]:
        done = _simplify(run, setup, policy, results["robustness_policy"], folder, report)
        calm = calm_policy(policy, done)
        cost = {"batches": done.batches, "episodes": done.episodes, "env_steps": done.env_steps}
        results["calm"] = judge(run, setup, calm) | cost
    write_results(folder, identity, arrays_of(policy), results, None if calm is None else arrays_of(calm))


def _simplify(
    run: Run, setup: Setup, policy: Policy, robustness: float, folder: Path, report: Callable[[int], None]
) -> Calm:
    """Makes the mean motion of a learned policy calm, from where an earlier session stopped; returns its last state."""
    identity = run.identity() + digest(policy.mean.tobytes())
    start = calm = begin(run, setup, policy)
    saved = read_calm_checkpoint(folder, identity)
    if saved is not None:
        with contextlib.suppress(DamagedError):
            start = from_arrays(start, saved)
    last_checkpoint = time.monotonic()
    asked = run.algorithm
    for calm in simplified(run, setup, policy, robustness, asked.calm_share, asked.calm, start):
        report(asked.iterations + calm.batches)
        if time.monotonic() - last_checkpoint > CHECKPOINT_SECONDS:
            write_calm_checkpoint(folder, identity, arrays_of(calm))
            last_checkpoint = time.monotonic()
    return calm


def _write_row(file: TextIO, row: dict[str, Any], header: bool) -> None:
    writer = csv.DictWriter(file, row, lineterminator="\n")
    if header:
        writer.writeheader()
    writer.writerow(row)
