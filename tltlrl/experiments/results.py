"""The runs of an experiment, read back: which are done, which are missing, and a finished one from its folder."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import yaml

from tltlrl.config.keys import machinery_defaults
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.experiments.manifest import with_start_of
from tltlrl.learning.policy import Policy
from tltlrl.store import layout
from tltlrl.store.bounded import read_yaml
from tltlrl.store.layout import CALM, CONFIG, DONE, LAST, SPECS
from tltlrl.store.run import DamagedError, read_checkpoint, read_results, shelve_checkpoint
from tltlrl.training.build import make_task
from tltlrl.training.learned import check_policy, learned_policy
from tltlrl.training.session import shorter_run
from tltlrl.training.study import Run, Study, with_later


def label(run: Run) -> str:
    """The name of a run in messages."""
    return f"{run.case.name} seed {run.seed}"


def run_folder(folder: Path, run: Run) -> Path:
    """The folder of a run, in the folder of its experiment."""
    return layout.run_folder(folder, run.case.name, run.seed)


def survey(folder: Path, study: Study) -> tuple[list[Run], int, list[str]]:
    """The runs that are missing, the number of finished runs, and messages about the missing ones.

    A run with damaged files is computed again, to the same bytes, because it depends only on its `Run`.
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
                shelve_checkpoint(path)  # it may have been killed between its last two steps
        except DamagedError as error:
            if shorter := shorter_run(run, path):
                missing.append(run)
                damages.append(_continued(run, shorter, path))
                continue
            damages.append(f"{path}: {error}; the run is computed again")
            if run not in missing[-1:]:
                missing.append(run)
    return missing, len(runs) - len(missing), damages


def _continued(run: Run, shorter: Run, path: Path) -> str:
    try:
        if read_checkpoint(path, shorter.identity(), LAST) is not None:
            return f"{label(run)} continues after its {shorter.algorithm.iterations} iterations"
        why = f"its {LAST} is missing"
    except DamagedError as error:
        why = str(error)
    return f"{label(run)} has only {shorter.algorithm.iterations} iterations, and starts again: {why}"


def finished(folder: Path, study: Study) -> dict[Path, dict[str, Any]]:
    """Folder => content of done.json of every finished run, in the order of the tables."""
    results, task = {}, make_task(study.task)
    for run in study.runs():
        path = run_folder(folder, run)
        with contextlib.suppress(DamagedError):  # computing it again has failed
            if (content := read_results(path, run.identity())) is not None:
                check_policy(task, learned_policy(path))
                results[path] = content
    return results


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


def _spec_copy(folder: Path, spec: str) -> Path:
    """The experiment's own copy of its spec."""
    path = folder / SPECS / Path(spec).name
    return path if path.exists() else path.with_name(f"{path.name}.tltl")
