"""`tltl-run`: trains and compares, as a config and the overrides on the command line say.

What takes time to import is imported by the functions that need it, so that mistakes are reported at once.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tltlrl.config.compose import GROUPS, as_meant, compose, one_seed, one_value, parse, searchpath
from tltlrl.errors import UserError
from tltlrl.resources import user_path

OPTIONS = ("--from", "--cfg", "-m", "--config-dir", "--version", "--help")


def tltl_run(arguments: list[str], told: Callable[[Callable[[], int]], int]) -> int:
    """`tltl-run ARGUMENTS`; its exit code.

    Args:
      arguments: of the command line.
      told: runs one experiment of several and reports what is wrong with it, for -m.

    Raises:
      UserError, SpecError: what the user has to mend.
    """
    chosen = _options(arguments)
    overrides = [*searchpath(chosen.config_dir), *(as_meant(text, chosen.multirun) for text in chosen.overrides)]
    if chosen.help:
        from tltlrl.config.usage import usage

        print(usage(overrides), end="")
        return 0
    if chosen.version:
        from tltlrl import __version__

        print(f"tltlrl {__version__}")
        return 0
    command = ["tltl-run", *arguments]
    if chosen.manifest is not None and (chosen.multirun or chosen.config_dir):
        raise UserError("--from: it repeats one experiment, as its manifest says; leave out -m and --config-dir")
    if chosen.multirun:
        if chosen.cfg:
            raise UserError("--cfg job: it shows the config of one experiment; leave out -m")

        from tltlrl.experiments.multirun import run_combinations

        return run_combinations(overrides, lambda config: told(lambda: _start(config, command)))
    settings = compose(overrides) if chosen.manifest is None else _repeated(chosen.manifest, overrides)
    if chosen.cfg:
        import yaml

        print(yaml.safe_dump(settings, sort_keys=False), end="")
        return 0
    return _start(settings, command)


def _start(settings: Mapping[str, Any], command: list[str]) -> int:
    from tltlrl.config.read import read

    study, machinery = read(settings)

    from tltlrl.experiments.experiment import (
        run_experiment,  # pandas and matplotlib take a second; no mistake should wait for them
    )

    return 0 if run_experiment(study, machinery, command) else 1


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> Any:
        """Raises a mistake as a UserError, without argparse's usage, which does not show the config."""
        raise UserError(f"{message} (see --help)")


def _options(arguments: list[str]) -> argparse.Namespace:
    """Parses the options, wherever they stand, and the overrides.

    Raises:
      UserError: if there is no such option, with the override that was meant.
    """
    parser = _Parser("tltl-run", add_help=False, allow_abbrev=False)
    parser.add_argument("--help", "-h", action="store_true")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--from", dest="manifest", nargs="?", const="")
    parser.add_argument("--cfg")
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=user_path)
    parser.add_argument("overrides", nargs="*")
    chosen, unknown = parser.parse_known_intermixed_args(arguments)
    if unknown:
        _refuse(unknown[0], arguments)
    if chosen.cfg not in (None, "job"):
        raise UserError(f"--cfg {chosen.cfg}: it can only be --cfg job")
    return chosen


def _refuse(option: str, arguments: list[str]) -> None:
    """Raises for an option that does not exist, and says what to write instead."""
    from tltlrl.config.keys import KEYS

    flag, _, value = option.partition("=")
    key = flag.lstrip("-").replace("-", "_")
    if key.split(".")[0] not in (*KEYS, *GROUPS, "seed"):
        raise UserError(f"{flag}: no such option; there are: {', '.join(OPTIONS)}")
    value = value or "".join(arguments[arguments.index(option) + 1 :][:1])
    if key in ("seed", "seeds"):
        raise UserError(f"{flag}: no such option; {one_seed(value)}")
    raise UserError(f"{flag}: no such option; write {key}={value} (see --help)")


def _repeated(manifest: str, overrides: Sequence[str]) -> dict[str, Any]:
    """The config of a manifest.json, with other values for some keys."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    from tltlrl.experiments.manifest import settings_in

    if not manifest:
        raise UserError("--from: give the manifest.json of an experiment, as in --from runs/NAME/manifest.json")
    config = OmegaConf.create(settings_in(user_path(manifest)))
    try:
        for override in parse(overrides):
            one_value(override)
            OmegaConf.update(config, override.get_key_element().lstrip("+"), override.value(), force_add=True)
        changed: Any = OmegaConf.to_container(config, resolve=True)
    except OmegaConfBaseException as error:
        raise UserError(f"--from: {str(error).splitlines()[0]}") from error
    return dict(changed)
