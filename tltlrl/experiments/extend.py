"""Whose results a folder holds, and whether another study may extend them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tltlrl.config.compare import differences
from tltlrl.config.keys import having, result_keys
from tltlrl.config.read import seeds_of
from tltlrl.errors import UserError
from tltlrl.experiments.folder import empty, is_record, read_record
from tltlrl.experiments.manifest import intact, read_manifest, spec_name
from tltlrl.experiments.results import run_folder
from tltlrl.settings import Role, fields_with
from tltlrl.store.files import clear_leftovers, digest, write_bytes, write_text
from tltlrl.store.layout import CONFIG, MANIFEST, SPECS, START
from tltlrl.training.study import AlgorithmConfig, Study, with_later


def check_ours(folder: Path, study: Study) -> None:
    """Checks that a folder may take our results, before anything in it is written, even its lock.

    Raises:
      UserError: if it holds something else, or a link in it would lead our files elsewhere.
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


def prepare(folder: Path, study: Study, overwrite: bool) -> tuple[Study, list[str]]:
    """Makes the folder ready: new, emptied with overwrite=true, or the same experiment's.

    Returns:
      The study with the folder's earlier seeds added, and messages about damage that was repaired.

    Raises:
      UserError: if it holds something else; it shows the difference.
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
    """The study with seeds of a config added: asking for fewer seeds makes no other experiment."""
    had = seeds_of(before)
    if set(had) <= set(study.seeds):
        return study
    seeds = tuple(dict.fromkeys([*had, *study.seeds]))
    setting = before if set(seeds) == set(had) else list(seeds)
    return dataclasses.replace(study, seeds=seeds, settings={**study.settings, "seeds": setting})


def changes(before: Mapping[str, Any], study: Study) -> str:
    """The differences that make a study another one than a result's config.yaml, one per line.

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
    growing = [*having(Role.GROWS), *(f"algorithm.{name}" for name in fields_with(Role.GROWS, AlgorithmConfig))]
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

    None if there is nothing but what a start that was stopped leaves behind.

    Raises:
      UserError: if the folder holds anything else; then nothing is written or deleted, even with overwrite=true.
    """
    names = {entry.name for entry in folder.iterdir() if not entry.name.startswith(".")}
    if not names - {SPECS, START}:
        return None, False
    if (before := read_record(folder / CONFIG, result_keys())) is not None:
        return before, False
    if known is not None and intact(known) is not False and is_record(known["config"], result_keys()):
        return known["config"], True
    raise UserError(
        f"{folder} exists and holds no results of tltl-run (its {CONFIG} is missing or not one of ours); "
        f"set another name=... or runs_dir=..."
    )
