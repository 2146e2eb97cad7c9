"""`tltl-run -m`: one experiment per combination of swept values, all checked before the first one starts.

Hydra's launcher runs them, one after the other or (hydra/launcher=...) as jobs of a cluster. Hydra's sweeper is not
used: it would notice a mistake in a combination only when it starts that one.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tltlrl.config.compose import complaints_told, completed, compose, initialized, parse, quoted
from tltlrl.config.keys import having
from tltlrl.config.read import read
from tltlrl.errors import UserError, module_of
from tltlrl.settings import Role
from tltlrl.store.files import digest

CODE_OF_HYDRA = ("hydra._internal.core_plugins.", "hydra_plugins.", "logging.", "colorlog.")
LONGEST_NAME = 200  # bytes; file systems allow 255


def run_combinations(overrides: Sequence[str], start: Callable[[dict[str, Any]], int]) -> int:
    """Starts every combination.

    Args:
      overrides: the overrides of all combinations; some have several values.
      start: runs the experiment of a config, perhaps in another process, reports mistakes, and returns the exit code.

    Returns:
      The first exit code that is not 0.

    Raises:
      UserError, SpecError: if any combination makes no experiment; then nothing was started.
    """
    hydras, swept = combinations(overrides)
    names = _checked([[*hydras, *combination] for combination, _ in swept], [values for _, values in swept])
    jobs = [
        [*completed(combination), f"name={quoted(name)}"] for (combination, _), name in zip(swept, names, strict=True)
    ]
    try:
        codes = _launch(hydras, jobs, start)
    except Exception as error:
        if not module_of(error).startswith("submitit."):
            raise
        print(f"tltl-run: hydra/launcher reports: {error}", file=sys.stderr)
        return 1
    failed = [name for name, code in zip(names, codes, strict=True) if code]
    if failed:
        print(
            f"tltl-run: {len(failed)} of {len(codes)} experiments failed: {' '.join(failed)}; if a launcher started "
            f"them, the jobs' logs say why",
            file=sys.stderr,
        )
    return next((code for code in codes if code), 0)


def combinations(overrides: Sequence[str]) -> tuple[list[str], list[tuple[list[str], list[str]]]]:
    """Divides overrides into Hydra's own and those of every combination.

    Returns:
      Hydra's own overrides; for every combination, all its other overrides and the swept ones among them.

    Raises:
      UserError: if an override cannot be read, or has no finite number of values.
    """
    hydras: list[str] = []
    alternatives: dict[str, list[str]] = {}  # of a key that is given twice the last one counts, as without -m
    swept = set()
    for override in parse(overrides):
        key = override.get_key_element()
        if override.is_hydra_override():
            hydras.append(override.input_line)
        elif not override.is_sweep_override():
            alternatives[key] = [override.input_line]
            swept.discard(key)
        elif override.is_discrete_sweep():
            alternatives[key] = [f"{key}={value}" for value in override.sweep_string_iterator()]
            swept.add(key)
        else:
            written, name = override.input_line.lstrip("+"), key.lstrip("+")
            raise UserError(f"{written}: -m needs single values, as in {name}=0.2,0.5 or range(1,4)")
    return hydras, [
        (list(chosen), [text for key, text in zip(alternatives, chosen, strict=True) if key in swept])
        for chosen in itertools.product(*alternatives.values())
    ]


def folder_name(name: str, swept: Sequence[str]) -> str:
    """The name of a combination's folder: the experiment's name and the values that differ between combinations.

    Left out are `experiment` and keys with the roles NAMES, GROWS and MACHINERY.
    """
    values = [text.lstrip("+") for text in swept]
    untold = ("experiment", *having(Role.NAMES | Role.GROWS | Role.MACHINERY))
    told = [text for text in values if text.partition("=")[0].split(".")[0] not in untold]
    whole = ",".join([name, *told]).replace("/", "-").encode()
    if len(whole) <= LONGEST_NAME:
        return whole.decode()
    return f"{whole[: LONGEST_NAME - 9].decode(errors='ignore')}-{digest(whole)[:8]}"


def _checked(combined: Sequence[Sequence[str]], swept: Sequence[Sequence[str]]) -> list[str]:
    """The names of all combinations, after a check that each makes an experiment and has its own folder."""
    names: dict[Path, str] = {}
    for overrides, values in zip(combined, swept, strict=True):
        settings = compose(overrides)
        study, machinery = read(settings | {"name": folder_name(str(settings["name"]), values)})
        folder = machinery.folder(study.name)
        if folder in names:
            raise UserError(
                f"-m: two combinations have the same folder {folder}; sweep what makes them different experiments "
                f"(one experiment takes lists of cases and seeds, as in seeds=[1,2]), or name, too"
            )
        names[folder] = study.name
    if not names:
        raise UserError("-m: a range without values makes no experiment")
    return list(names.values())


def _launch(hydras: Sequence[str], jobs: Sequence[Sequence[str]], start: Callable[[dict[str, Any]], int]) -> list[int]:
    """Runs jobs with Hydra's launcher, which Hydra's own overrides may choose; returns their exit codes."""
    from hydra._internal.callbacks import Callbacks
    from hydra.core.global_hydra import GlobalHydra
    from hydra.core.plugins import Plugins
    from hydra.types import HydraContext, RunMode
    from omegaconf import OmegaConf

    def job(config: Any) -> int:
        settings: Any = OmegaConf.to_container(config, resolve=True)
        return start(settings)

    with initialized():
        hydra = GlobalHydra.instance().hydra
        with complaints_told(hydras):
            config = hydra.compose_config(
                "config", [*hydras, *jobs[0]], RunMode.MULTIRUN, from_shell=False, with_log_configuration=False
            )
            _check_names_no_code(OmegaConf.to_container(config.hydra, resolve=False))
            context = HydraContext(config_loader=hydra.config_loader, callbacks=Callbacks(config))
            launcher = Plugins.instance().instantiate_launcher(hydra_context=context, task_function=job, config=config)
        return [done.return_value for done in launcher.launch(jobs, 0)]


def _check_names_no_code(section: Any, key: str = "hydra") -> None:
    """Checks that Hydra's own section imports only Hydra and its installed plugins, and does not change the folder.

    Raises:
      UserError: if a key does; it names the key.
    """
    if key == "hydra.callbacks" and section:
        raise UserError(f"{key}: it names code to be run, which no config may; leave it out")
    if key == "hydra.job.chdir" and section:
        raise UserError(f"{key}: runs_dir would be looked for in another folder; leave it out")
    if key.endswith(("._target_", ".()", ".class")) and not str(section).startswith(CODE_OF_HYDRA):
        raise UserError(f"{key}={section}: it names code to be imported, which no config may; leave it out")
    for name, value in (
        section.items() if isinstance(section, dict) else enumerate(section if isinstance(section, list) else ())
    ):
        _check_names_no_code(value, f"{key}.{name}")
