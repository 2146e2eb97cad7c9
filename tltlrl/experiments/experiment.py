"""Many runs: every case with every seed, in one folder, then the tables and figures of what they show."""

from __future__ import annotations

import contextlib
import dataclasses
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import yaml

from tltlrl.config.compare import differences
from tltlrl.config.keys import Role, having, kept, machinery_defaults
from tltlrl.config.machinery import Machinery
from tltlrl.config.read import read, seeds_of
from tltlrl.errors import UserError
from tltlrl.experiments.engine import run_all
from tltlrl.experiments.folder import empty, is_record, read_record, working_in
from tltlrl.experiments.manifest import (
    end_session,
    intact,
    manifest,
    put_right,
    read_manifest,
    spec_name,
    start_session,
    with_computed,
    with_start_of,
)
from tltlrl.experiments.progress import Progress
from tltlrl.experiments.provenance import provenance
from tltlrl.experiments.scheduler import check_scheduler
from tltlrl.learning.policy import Policy
from tltlrl.reports.motion import has_path
from tltlrl.reports.page import write_page
from tltlrl.reports.plotting import FORMATS, shows
from tltlrl.reports.report import median_run, write_report
from tltlrl.reports.workspace import draw_workspace
from tltlrl.store import layout
from tltlrl.store.bounded import read_yaml
from tltlrl.store.clauses import standing_so_far
from tltlrl.store.files import clear_leftovers, digest, write_bytes, write_json, write_text
from tltlrl.store.layout import (
    CALM,
    CALM_WORKSPACE,
    CONFIG,
    DONE,
    LOG,
    MANIFEST,
    POLICY,
    SPECS,
    START,
    WORKSPACE,
)
from tltlrl.store.run import DamagedError, read_checkpoint, read_results, shelve_checkpoint
from tltlrl.training.build import cut_windows, make_task, unlike_resets
from tltlrl.training.session import check_policy, learned_policy, shorter_run
from tltlrl.training.study import Run, Study, with_later

RECORDS = 100  # how often manifest.json is written in a session, at most: it lists every run
ITERATIONS = "algorithm.iterations"  # more of them go on where fewer have ended


def processors() -> int:
    """How many this process may use; those of the whole machine where, as on macOS, the system does not say."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_experiment(study: Study, machinery: Machinery, command: list[str]) -> bool:
    """Computes what is missing of a study and writes its tables and figures.

    Args:
      study: what to do.
      machinery: how, and where to.
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

        if missing or before is None:  # otherwise nothing here is of this session, and the manifest stays as it is
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
    return not failures


def check_ours(folder: Path, study: Study) -> None:
    """Whether a folder is there for our results, looked at before anything in it is written, its lock included.

    Raises:
      UserError: if it holds something else, or what is written into it would go elsewhere through a link.
    """
    if not folder.is_dir():
        return
    _settings_before(folder, read_manifest(folder / MANIFEST))
    inner = {
        folder / SPECS,
        *(path for run in study.runs() for path in (run_folder(folder, run).parents[0], run_folder(folder, run))),
    }
    for path in sorted(inner):
        if path.is_symlink():
            raise UserError(f"{path} is a link, and results are not written through it; link {folder} as a whole")


def label(run: Run) -> str:
    """The run, as it is called in messages."""
    return f"{run.case.name} seed {run.seed}"


def run_folder(folder: Path, run: Run) -> Path:
    """Where a run's files lie, in the folder of its experiment."""
    return layout.run_folder(folder, run.case.name, run.seed)


def survey(folder: Path, study: Study) -> tuple[list[Run], int, list[str]]:
    """The runs that have to be computed, the number of those that are done, and what there is to say of the first.

    A run whose files are damaged is computed again: to the same bytes, since it depends on nothing but its `Run`.
    """
    missing, damages = [], []
    runs, task = study.runs(), make_task(study.task)
    for run in runs:
        path = run_folder(folder, run)
        try:
            if read_results(path, run.identity()) is None:
                missing.append(run)
                read_checkpoint(path, run.identity())
            else:
                check_policy(task, learned_policy(path))
                shelve_checkpoint(path)  # killed between its last two steps
        except DamagedError as error:
            if shorter := shorter_run(run, path):
                missing.append(run)
                damages.append(f"{label(run)} continues after its {shorter.algorithm.iterations} iterations")
                continue
            damages.append(f"{path}: {error}; the run is computed again")
            if run not in missing[-1:]:
                missing.append(run)
    return missing, len(runs) - len(missing), damages


def finished(folder: Path, study: Study) -> dict[Path, dict[str, Any]]:
    """Folder => content of done.json of every finished run, in the order of the tables."""
    results, task = {}, make_task(study.task)
    for run in study.runs():
        path = run_folder(folder, run)
        with contextlib.suppress(DamagedError):  # it was to be computed again, and that failed
            if (content := read_results(path, run.identity())) is not None:
                check_policy(task, learned_policy(path))
                results[path] = content
    return results


def draw_cases(folder: Path, study: Study, results: Mapping[Path, Mapping[str, Any]]) -> None:
    """The workspace of every case, if the task has one: the seed with the median robustness of the mean policy.

    Pictures that are whole and of this seed's policies stay.
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


def open_run(folder: Path) -> tuple[Run, Policy]:
    """A finished run read back from its folder, <experiment>/<case>/seed_<k>.

    Raises:
      UserError: if there is no finished run.
    """
    above = folder.resolve().parent.parent
    advice = "give one like runs/reach_avoid/tltl_episodic/seed_0"
    try:
        settings = read_yaml(above / CONFIG)
        settings["spec"] = str(_spec_copy(above, settings["spec"]))
        settings = with_start_of(above, settings)
        policy = learned_policy(folder)
        (folder / DONE).read_text(encoding="utf-8")
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError) as error:
        raise UserError(f"{folder} is not the folder of a finished run ({error}); {advice}") from error
    study, _ = read(with_later(settings) | machinery_defaults())
    for run in study.runs():
        if run_folder(above, run) == folder.resolve():
            try:
                read_results(folder, run.identity())
                check_policy(make_task(run.task), policy)
            except DamagedError as error:
                raise UserError(
                    f"{folder}: {error}; start its tltl-run again, which computes anew what is damaged"
                ) from error
            return run, policy
    raise UserError(f"{folder}: {above / CONFIG} knows no such case and seed")


def open_calm(run: Run, folder: Path) -> Policy | None:
    """The calm policy of a finished run that `open_run` has read; None if it has none.

    Raises:
      UserError: if its file cannot be read.
    """
    try:
        if not (folder / CALM).exists():
            return None
        calm = learned_policy(folder, CALM)
        check_policy(make_task(run.task), calm)
        return calm
    except DamagedError as error:
        raise UserError(f"{folder}: {error}; start its tltl-run again, which computes anew what is damaged") from error


def compute(
    folder: Path,
    study: Study,
    machinery: Machinery,
    missing: list[Run],
    progress: Progress,
    computed: Callable[[Run, str], None],
) -> dict[str, str]:
    """Computes runs; what failed, as case/seed_k => message.

    Args:
      folder: of the experiment.
      study, machinery: what, and how.
      missing: the runs.
      progress: told of them.
      computed: called with every run that has finished, and the machine that computed it.

    Raises:
      OSError: if files cannot be written, which the runs that are left could not either.
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
    progress.say(f"{len(missing)} runs of {study.algorithm.iterations} iterations into {folder}")
    try:
        run_all(jobs, workers, machinery.address, progress.advance, on_end, progress.say)
    except KeyboardInterrupt:
        progress.say(f"stopped; what is done is kept in {folder}")
        raise
    return failures


def prepare(folder: Path, study: Study, overwrite: bool) -> tuple[Study, list[str]]:
    """Makes the folder ready: new, emptied with overwrite=true, or the same experiment's.

    Returns:
      The study with the seeds that the folder has already, and what was damaged in it and was mended.

    Raises:
      UserError: if it holds something else, with the difference.
    """
    clear_leftovers(folder)
    clear_leftovers(folder / SPECS)
    config, spec_copy = folder / CONFIG, folder / SPECS / spec_name(study)
    known = read_manifest(folder / MANIFEST)
    before, restored = _settings_before(folder, known)
    notes = []
    if before is not None and overwrite:
        empty(folder, config)
    elif before is not None:
        wrong = changes(before, study)
        if not wrong and known is not None and intact(known) and (changed := changes(known["config"], study)):
            raise UserError(
                f"{folder}: its {CONFIG} was changed, and the results are of the config in {MANIFEST}:\n{changed}\n"
                f"Set another name=... (now {study.name}), or overwrite=true to delete what is there."
            )
        if wrong:
            if known is None or not intact(known) or changes(known["config"], study):
                raise UserError(
                    f"{folder} holds results of another config:\n{wrong}\n"
                    f"Set another name=... (now {study.name}), or overwrite=true to delete what is there."
                )
            restored = True
        if restored:
            notes.append(f"{CONFIG} was missing or damaged and is written again, from {MANIFEST}")
        text = study.spec.text.encode()
        if not spec_copy.is_file() or spec_copy.read_bytes() != text:
            if known is None or intact(known) is False or known["specs"] != {spec_copy.name: digest(text)}:
                raise UserError(
                    f"{folder} was made with another text of {spec_copy.name} (kept in its folder specs), or its copy "
                    f"was damaged or deleted. Set another name=..., or overwrite=true to delete what is there."
                )
            notes.append(f"{SPECS}/{spec_copy.name} was missing or damaged and is written again")
    start, start_copy = study.algorithm.start(), folder / START
    if start is not None:
        if start_copy.exists() and start_copy.read_bytes() != start:
            raise UserError(
                f"{folder} was made from another policy (kept there as {START}). Set another name=..., or "
                "overwrite=true to delete what is there."
            )
        write_bytes(start_copy, start)
    (folder / SPECS).mkdir(parents=True, exist_ok=True)
    whole = study if before is None or overwrite else with_seeds(study, before["seeds"])
    write_text(spec_copy, study.spec.text)
    write_text(config, yaml.safe_dump(dict(whole.settings), sort_keys=False))
    return whole, notes


def with_seeds(study: Study, before: Any) -> Study:
    """The study with these seeds, too, as a config gives them: asking for fewer is no other experiment."""
    had = seeds_of(before)
    if set(had) <= set(study.seeds):
        return study
    seeds = tuple(dict.fromkeys([*had, *study.seeds]))
    setting = before if set(seeds) == set(had) else list(seeds)
    return dataclasses.replace(study, seeds=seeds, settings={**study.settings, "seeds": setting})


def changes(before: Mapping[str, Any], study: Study) -> str:
    """What makes a study another one than that of a result's config.yaml, one line each.

    It may have more cases and iterations and any seeds, and the settings of a learner that had no case before.
    """
    cases = before.get("cases")
    had = {case.learner for case in study.cases if isinstance(cases, list) and case.name in cases}
    added = {
        f"algorithm.{field.name}"
        for name, own in study.learners.items()
        for field in dataclasses.fields(own)
        if name not in had
    }
    growing = [*having(Role.GROWS), ITERATIONS]
    had_then = {**before, "seeds": study.settings["seeds"]}
    if isinstance(before.get("algorithm"), dict):  # of any version, and perhaps damaged
        had_then["algorithm"] = {
            key: value
            for key, value in with_later(before)["algorithm"].items()
            if key in before["algorithm"] or key in study.settings["algorithm"]
        }
        if had_then["algorithm"].get("policy") and study.algorithm.policy:  # its bytes count, and not where it lies
            had_then["algorithm"]["policy"] = study.algorithm.policy
    return differences(had_then, study.settings, growing, added)


def _settings_before(folder: Path, known: Mapping[str, Any] | None) -> tuple[dict[str, Any] | None, bool]:
    """The config of the results in `folder`, and whether it had to be taken from the manifest `known`.

    None if there is nothing but what a start leaves behind.

    Raises:
      UserError: if the folder holds anything else; it is neither written to nor, with overwrite=true, deleted.
    """
    names = {entry.name for entry in folder.iterdir() if not entry.name.startswith(".")}
    if not names - {SPECS, START}:
        return None, False
    if (before := read_record(folder / CONFIG, kept())) is not None:
        return before, False
    if known is not None and intact(known) is not False and is_record(known["config"], kept()):
        return known["config"], True
    raise UserError(
        f"{folder} exists and holds no results of tltl-run (its {CONFIG} is missing or not one of ours); "
        f"set another name=... or runs_dir=..."
    )


def _spec_copy(folder: Path, spec: str) -> Path:
    """The experiment's own copy of its spec."""
    path = folder / SPECS / Path(spec).name
    return path if path.exists() else path.with_name(f"{path.name}.tltl")
