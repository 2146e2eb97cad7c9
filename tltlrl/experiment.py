"""Many runs: every case with every seed, in one folder, then the tables and figures of what they show."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from tltlrl.config import KEYS, MACHINERY_DEFAULTS, Experiment, experiment_from
from tltlrl.engine import check_scheduler, run_all
from tltlrl.errors import UserError
from tltlrl.files import read_arrays, write_json, write_text
from tltlrl.manifest import end_session, manifest, read_manifest, start_session
from tltlrl.policy import Policy
from tltlrl.progress import Progress
from tltlrl.report import write_report
from tltlrl.training import DONE, POLICY, Run

CONFIG, MANIFEST, SPECS, LOG, LOCK = "config.yaml", "manifest.json", "specs", "log.txt", ".lock"
GROWING = ("cases", "seeds")  # more of these extend a folder; anything else makes it another experiment


def run_experiment(experiment: Experiment, command: list[str]) -> bool:
    """Computes what is missing of an experiment and writes its tables and figures.

    Args:
      experiment: what to do.
      command: the command line, for the manifest.

    Returns:
      Whether every run succeeded.

    Raises:
      UserError: if the folder holds another experiment or another process works in it.
    """
    folder = Path(experiment.runs_dir) / experiment.name
    if experiment.engine.address is not None:
        check_scheduler(experiment.engine.address)
    with lock(folder):
        prepare(folder, experiment)
        missing = [run for run in experiment.runs() if not (run_folder(folder, run) / DONE).exists()]
        before = read_manifest(folder / MANIFEST)
        if missing:  # otherwise nothing here is of this session, and the manifest stays as it is
            session = start_session(command)
            write_json(folder / MANIFEST, manifest(experiment, before, session))
        failures = compute(folder, experiment)
        write_report(folder, experiment, failures)
        if missing:
            write_json(folder / MANIFEST, manifest(experiment, before, end_session(session)))
    return not failures


def run_folder(folder: Path, run: Run) -> Path:
    """Where a run's files lie."""
    return folder / run.case.name / f"seed_{run.seed}"


def open_run(folder: Path) -> tuple[Run, Policy]:
    """A finished run read back from its folder, <experiment>/<case>/seed_<k>.

    Raises:
      UserError: if there is no finished run.
    """
    above = folder.resolve().parent.parent
    try:
        settings = yaml.safe_load((above / CONFIG).read_text())
        settings["spec"] = str(_spec_copy(above, settings["spec"]))
        saved = read_arrays(folder / POLICY)
        policy = Policy(saved["gain"], saved["mean"], saved["covariance"], float(saved["correlation"]))
        (folder / DONE).read_text()
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile, yaml.YAMLError) as error:
        raise UserError(
            f"{folder} is not the folder of a finished run ({error}); "
            "give one like runs/reach_avoid/tltl_episodic/seed_0"
        ) from error
    experiment = experiment_from(settings | MACHINERY_DEFAULTS)
    for run in experiment.runs():
        if run_folder(above, run) == folder.resolve():
            return run, policy
    raise UserError(f"{folder}: {above / CONFIG} knows no such case and seed")


def compute(folder: Path, experiment: Experiment) -> dict[str, str]:
    """Runs what is not done; what failed, as case/seed_k => message."""
    jobs = [(run, run_folder(folder, run)) for run in experiment.runs()]
    missing = [(run, path) for run, path in jobs if not (path / DONE).exists()]
    labels = [f"{run.case.name} seed {run.seed}" for run, _ in missing]
    failures: dict[str, str] = {}
    with Progress(labels, experiment.algorithm.iterations, folder / LOG) as progress:
        if len(missing) < len(jobs):
            progress.say(f"{len(jobs) - len(missing)} of {len(jobs)} runs were done before and are kept")
        if not missing:
            return failures

        def on_end(index: int, error: Exception | None) -> None:
            progress.end(index, error)
            if error is not None:
                failures[str(missing[index][1].relative_to(folder))] = f"{type(error).__name__}: {error}"

        workers = min(experiment.workers or len(os.sched_getaffinity(0)), len(missing))
        progress.say(f"{len(missing)} runs of {experiment.algorithm.iterations} iterations into {folder}")
        try:
            run_all(missing, workers, experiment.engine.address, progress.advance, on_end)
        except KeyboardInterrupt:
            progress.say(f"stopped; what is done is kept in {folder}")
            raise
    return failures


def prepare(folder: Path, experiment: Experiment) -> None:
    """Makes the folder ready: new, emptied with overwrite=true, or the same experiment's.

    Raises:
      UserError: if it holds something else, with the difference.
    """
    config = folder / CONFIG
    before = _settings_before(folder)
    if before is not None and experiment.overwrite:
        for entry in folder.iterdir():
            if entry.name != LOCK:
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
    elif before is not None:
        _check_same(before, experiment.settings, folder)
        spec_before = folder / SPECS / spec_name(experiment)
        if not spec_before.exists() or spec_before.read_text() != experiment.spec.text:
            raise UserError(
                f"{folder} was made with another text of {spec_name(experiment)} (kept in its folder specs). "
                f"Set another name=..., or overwrite=true to delete it."
            )
    (folder / SPECS).mkdir(parents=True, exist_ok=True)
    write_text(folder / SPECS / spec_name(experiment), experiment.spec.text)
    write_text(config, yaml.safe_dump(experiment.settings, sort_keys=False))


def spec_name(experiment: Experiment) -> str:
    """The spec file's own name."""
    return Path(experiment.spec.path or "spec.tltl").name


def _settings_before(folder: Path) -> dict[str, Any] | None:
    """The config of the results in `folder`; None if there is nothing but what a start leaves behind.

    Raises:
      UserError: if the folder holds anything else; it is neither written to nor, with overwrite=true, deleted.
    """
    names = {entry.name for entry in folder.iterdir() if not entry.name.startswith(".")}
    if not names - {SPECS}:
        return None
    try:
        before = yaml.safe_load((folder / CONFIG).read_text())
    except (OSError, yaml.YAMLError):
        before = None
    if not isinstance(before, dict) or set(before) != set(KEYS) - set(MACHINERY_DEFAULTS):
        raise UserError(
            f"{folder} exists and holds no results of tltl-run (its {CONFIG} is missing or not one of ours); "
            f"set another name=... or runs_dir=..."
        )
    return before


def _spec_copy(folder: Path, spec: str) -> Path:
    """The experiment's own copy of its spec."""
    path = folder / SPECS / Path(spec).name
    return path if path.exists() else path.with_name(f"{path.name}.tltl")


def _check_same(before: Mapping[str, Any], now: Mapping[str, Any], folder: Path) -> None:
    old, new = flatten(before), flatten(now)
    differences = [
        f"  {key}: {old.get(key, 'absent')} there, {new.get(key, 'absent')} now"
        for key in sorted(old.keys() | new.keys())
        if old.get(key) != new.get(key) and key not in GROWING
    ]
    for key in GROWING:
        kept, wanted = _members(before.get(key)), _members(now.get(key))
        if not kept <= wanted:
            differences.append(f"  {key}: {before.get(key)} there, {now.get(key)} now (they can only grow)")
    if differences:
        lines = "\n".join(differences)
        raise UserError(
            f"{folder} holds results of another config:\n{lines}\n"
            f"Set another name=... (now {now['name']}), or overwrite=true to delete what is there."
        )


def _members(value: Any) -> set[Any]:
    return set(range(value)) if isinstance(value, int) else set(value or ())


def flatten(config: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in config.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            flat[f"{prefix}{key}"] = value
    return flat


@contextlib.contextmanager
def lock(folder: Path) -> Iterator[None]:
    """Holds the folder for this process.

    Raises:
      UserError: if another process holds it, or it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = open(folder / LOCK, "a+")  # noqa: SIM115  # closed below, after the experiment
    except OSError as error:
        raise UserError(f"{folder} cannot be written ({error.strerror}); set another runs_dir=...") from error
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            holder = file.read().strip() or "unknown"
            raise UserError(f"process {holder} is working in {folder}; wait for it, or set another name=...") from error
        file.truncate(0)
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield
