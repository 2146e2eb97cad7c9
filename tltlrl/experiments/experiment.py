"""Computes an experiment: every case with every seed in one folder, then tables and figures."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tltlrl.config.machinery import Machinery
from tltlrl.errors import UserError
from tltlrl.experiments.engine import run_all
from tltlrl.experiments.extend import check_ours, prepare
from tltlrl.experiments.folder import working_in
from tltlrl.experiments.manifest import (
    end_session,
    intact,
    manifest,
    put_right,
    read_manifest,
    start_session,
    with_computed,
)
from tltlrl.experiments.progress import Progress
from tltlrl.experiments.provenance import provenance
from tltlrl.experiments.results import finished, label, open_calm, run_folder, survey
from tltlrl.experiments.scheduler import check_scheduler
from tltlrl.reports.motion import has_path
from tltlrl.reports.page import write_page
from tltlrl.reports.plotting import FORMATS, shows
from tltlrl.reports.report import median_run, write_report
from tltlrl.reports.workspace import draw_workspace
from tltlrl.store.clauses import standing_so_far
from tltlrl.store.files import clear_leftovers, digest, write_json
from tltlrl.store.layout import (
    CALM,
    CALM_WORKSPACE,
    DONE,
    LOG,
    MANIFEST,
    PAGE,
    POLICY,
    REPORT,
    WORKSPACE,
)
from tltlrl.training.build import make_task
from tltlrl.training.check import cut_windows, unlike_resets
from tltlrl.training.learned import learned_policy
from tltlrl.training.study import Run, Study

RECORDS = 100  # most writes of manifest.json in a session, because it lists every run


def processors() -> int:
    """How many processors this process may use; all of the machine if the system does not say it, as on macOS."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_experiment(study: Study, machinery: Machinery, command: list[str]) -> bool:
    """Computes the missing runs of a study, and writes its tables and figures.

    Args:
      study: what to do.
      machinery: how to do it, and where.
      command: the command line, for the manifest.

    Returns:
      Whether every run succeeded.

    Raises:
      UserError: if the folder holds another experiment or another process works in it.
    """
    folder = machinery.folder(study.name)
    if machinery.address is not None:
        check_scheduler(machinery.address)
    check_ours(folder, study)
    with working_in(folder):
        whole, notes = prepare(folder, study, machinery.overwrite)
        missing, done, damages = survey(folder, study)
        before = read_manifest(folder / MANIFEST)
        if done and before is None:
            notes.append(f"{MANIFEST} was missing or damaged: who computed the results kept here is no longer known")
        if before is not None and intact(before) is False:
            notes.append(f"{MANIFEST} is not as it was written: its config is corrected, the rest is kept as it is")
            before = put_right(whole, before)
            write_json(folder / MANIFEST, before)
        if missing:
            notes += filter(None, (cut_windows(study), unlike_resets(study)))
        recorded = before  # what manifest.json says

        def record(session: Mapping[str, Any]) -> None:
            nonlocal recorded
            recorded = manifest(whole, before, session)
            write_json(folder / MANIFEST, recorded)

        if missing or before is None:  # otherwise this session computed nothing, and the manifest does not change
            session = start_session(command)
            record(session)

        def computed(run: Run, machine: str) -> None:
            nonlocal session
            session = with_computed(session, f"{run.case.name}/seed_{run.seed}", machine)
            if len(session["computed"]) % -(-len(missing) // RECORDS) == 0:
                record(session)

        paths = [run_folder(folder, run) for run in missing]
        with Progress(
            [label(run) for run in missing],
            study.algorithm.iterations,
            folder / LOG,
            lambda index: standing_so_far(paths[index]),
            calm=study.algorithm.calm,
        ) as progress:
            for note in [*notes, *damages]:
                progress.say(note)
            if done:
                progress.say(f"{done} of {done + len(missing)} runs were done before and are kept")
            try:
                failures = compute(folder, study, machinery, missing, progress, computed) if missing else {}
            except BaseException:  # Ctrl-C above all
                record(session)
                raise
            results = finished(folder, whole)
            lines, tables = write_report(folder, whole, results, failures)
            for line in lines:
                progress.say(line)
            draw_cases(folder, whole, results)
            if missing or before is None:
                record(end_session(session))
            if tables is not None:
                assert recorded is not None
                write_page(folder, whole, tables, results, failures, provenance(whole, recorded))
                progress.say(f"report: {folder / REPORT}, {PAGE}")  # said once both are there
    return not failures


def draw_cases(folder: Path, study: Study, results: Mapping[Path, Mapping[str, Any]]) -> None:
    """Draws the workspace of every case, if the task has one, for the seed with the median robustness.

    Complete pictures of the same policies are kept.
    """
    if not has_path(make_task(study.task), study.spec):
        return
    for case in study.cases:
        clear_leftovers(folder / case.name)
        median = median_run(results, case.name)
        if median is None:
            continue
        runs = {run_folder(folder, run): run for run in study.runs() if run.case == case}
        calm = open_calm(runs[median], median)
        for policy, file, name in ((learned_policy(median), POLICY, WORKSPACE), (calm, CALM, CALM_WORKSPACE)):
            path = folder / case.name / name
            if policy is None:
                clear_pictures(path)
            elif not shows(path, source := digest((median / file).read_bytes())):
                draw_workspace(runs[median], policy, path, source=source)


def clear_pictures(path: Path) -> None:
    """Deletes a picture in all its formats, if there is one."""
    for suffix in FORMATS:
        path.with_name(f"{path.name}{suffix}").unlink(missing_ok=True)


def compute(
    folder: Path,
    study: Study,
    machinery: Machinery,
    missing: list[Run],
    progress: Progress,
    computed: Callable[[Run, str], None],
) -> dict[str, str]:
    """Computes runs and returns the failures, case/seed_k => message.

    Args:
      folder: folder of the experiment.
      study, machinery: what to compute, and how.
      missing: the runs to compute.
      progress: shows how far they are.
      computed: called with every finished run and the machine that computed it.

    Raises:
      OSError: if files cannot be written; the remaining runs would fail too.
    """
    jobs = [(run, run_folder(folder, run).resolve()) for run in missing]
    failures: dict[str, str] = {}

    def on_end(index: int, error: Exception | None, machine: str) -> None:
        run, path = jobs[index]
        if isinstance(error, OSError) and error.filename is not None:
            raise error
        if error is None and not (path / DONE).exists():
            error = UserError(f"its results are not in {path}; do the workers see the same files as this command?")
        progress.end(index, error)
        if error is None:
            computed(run, machine)
        else:
            failures[f"{run.case.name}/seed_{run.seed}"] = f"{type(error).__name__}: {error}"

    workers = min(machinery.workers or processors(), len(missing))
    runs = "1 run" if len(missing) == 1 else f"{len(missing)} runs"
    progress.say(f"{runs} of {study.algorithm.iterations} iterations into {folder}")
    try:
        run_all(jobs, workers, machinery.address, progress.advance, on_end, progress.say)
    except KeyboardInterrupt:
        progress.say(f"stopped; what is done is kept in {folder}")
        raise
    return failures
