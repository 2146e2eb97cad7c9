"""Takes one run from where it stands to its end: resume, iterate, checkpoint, judge."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from tltlrl.errors import UserError
from tltlrl.learning.learner import Learner
from tltlrl.learning.policy import Policy
from tltlrl.store.files import clear_leftovers, digest, naming, write_bytes
from tltlrl.store.layout import CLAUSES, DONE, LAST, POLICY, PROGRESS, TIMING
from tltlrl.store.lock import BusyError, held
from tltlrl.store.run import (
    Checkpoint,
    DamagedError,
    drop_checkpoint,
    first_rows,
    iterations_done,
    read_calm_checkpoint,
    read_checkpoint,
    read_policy,
    read_results,
    shelve_checkpoint,
    write_calm_checkpoint,
    write_checkpoint,
    write_results,
)
from tltlrl.tasks.task import Task
from tltlrl.training.build import Setup, first_policy, make_learner, make_task, policy_of, refined_policy, set_up
from tltlrl.training.calm import Calm, begin, calm_policy, simplified
from tltlrl.training.loop import iterate
from tltlrl.training.study import Run
from tltlrl.training.verdict import judge, robustness_of

CHECKPOINT_SECONDS = 2.0
LOCK_SECONDS = 10.0  # a worker ends within a few seconds after its command was killed


@dataclass(frozen=True)
class Stand:
    """Where a run stands, as its checkpoint holds it.

    Attributes:
      state: the learner's state.
      best: the policy with the best mean motion simulated so far; the first policy before any was simulated.
      robustness: the robustness of that motion.
    """

    state: Any
    best: Policy
    robustness: float

    def seen(self, policy: Policy, robustness: float) -> Stand:
        """The stand after a policy's mean motion was simulated. If two are equally good, the newer is the best."""
        better = robustness >= self.robustness
        return Stand(self.state, policy if better else self.best, robustness if better else self.robustness)


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


def resume(folder: Path, identity: str, like: Callable[[int], Any]) -> tuple[int, int, Any]:
    """Iterations done, their samples, and where a run stands; cuts the CSV files back to the checkpoint.

    Without a usable checkpoint the run starts again from its first state.

    Args:
      folder, identity: of the run.
      like: iterations done => a stand with the fields that the checkpoint should have; for 0, the first one.
    """
    try:
        saved = read_checkpoint(folder, identity)
        state = saved and from_arrays(like(saved.iteration), saved.state)
    except DamagedError:  # the command has said so; see tltlrl.experiments.results.survey
        saved = state = None
    if saved is None or state is None:
        drop_checkpoint(folder)
        for name in (PROGRESS, CLAUSES, TIMING):
            (folder / name).unlink(missing_ok=True)
        return 0, 0, like(0)
    for name in (PROGRESS, CLAUSES, TIMING):
        write_bytes(folder / name, first_rows(folder / name, saved.iteration))
    return saved.iteration, saved.env_steps, state


def arrays_of(state: Any) -> dict[str, np.ndarray]:
    """The fields of a dataclass of arrays and numbers, by name; fields of a nested dataclass as `name.field`."""
    arrays: dict[str, np.ndarray] = {}
    for field in dataclasses.fields(state):
        value = getattr(state, field.name)
        if dataclasses.is_dataclass(value):
            arrays |= {f"{field.name}.{name}": array for name, array in arrays_of(value).items()}
        else:
            arrays[field.name] = np.asarray(value)
    return arrays


def from_arrays(like: Any, arrays: Mapping[str, np.ndarray]) -> Any:
    """A state with the fields of `like`, from the result of `arrays_of`; numbers become numbers again.

    Raises:
      DamagedError: if a field is missing, or there is an unknown one.
    """
    if set(arrays_of(like)) != set(arrays):
        raise DamagedError("the checkpoint is of another learner")
    values: dict[str, Any] = {}
    for field in dataclasses.fields(like):
        value, prefix = getattr(like, field.name), f"{field.name}."
        if dataclasses.is_dataclass(value):
            inner = {name.removeprefix(prefix): array for name, array in arrays.items() if name.startswith(prefix)}
            values[field.name] = from_arrays(value, inner)
        else:
            saved = arrays[field.name]
            values[field.name] = saved if isinstance(value, np.ndarray) else saved.item()
    return type(like)(**values)


def learned_policy(folder: Path, name: str = POLICY) -> Policy:
    """A policy of a finished run, read from its file.

    Args:
      folder: of the run.
      name: of the file: policy.npz, or calm.npz beside it.

    Raises:
      DamagedError: if the file cannot be read, or holds no policy.
    """
    try:
        return policy_of(read_policy(folder, name))
    except (KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} cannot be read ({error})") from error


def check_policy(task: Task, policy: Policy) -> None:
    """Checks that a policy has the shapes of the task, which its digest does not show.

    Raises:
      DamagedError: if it does not.
    """
    expected = (len(task.command_scale), task.width), (task.steps, len(task.command_scale))
    if (policy.gain.shape, policy.mean.shape) != expected:
        raise DamagedError(
            f"its policy has arrays of the shapes {policy.gain.shape} and {policy.mean.shape}, and {task.name} needs "
            f"{expected[0]} and {expected[1]}"
        )
    if not all(np.isfinite(array).all() for array in (policy.gain, policy.mean, policy.covariance)):
        raise DamagedError("its policy holds values that are not finite")
