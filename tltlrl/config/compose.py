"""Composes a config, as plain data, from the overrides of a command line; Hydra's errors become ours.

The functions that need Hydra import it themselves, because a command has to answer Ctrl-C before that.
"""

from __future__ import annotations

import contextlib
import dataclasses
import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

from tltlrl.config.compare import flatten
from tltlrl.config.keys import having, having_kind
from tltlrl.errors import UserError, module_of, nearest
from tltlrl.registry import OUTSIDE, TASKS
from tltlrl.resources import CONFIGS, OFFERED, is_page, user_path
from tltlrl.settings import Role
from tltlrl.store.bounded import BoundsError, check_yaml

GROUPS = ("experiment", *having(Role.CHOSEN))  # chosen by the name of a file in configs/
TEXTS = (*having_kind(str), "policy", "algorithm.policy")  # their values are plain text, taken as written
LISTS = having_kind(list)
OPEN = re.compile(r"(constants|algorithm|(task|reward)\.\w+)\.")  # sections whose keys may be missing from the config
WORDS = ("null", "true", "false", "nan", "inf")  # words that Hydra does not read as text


def compose(overrides: Sequence[str]) -> dict[str, Any]:
    """Composes the config of these overrides.

    Raises:
      UserError: if an override or a file is wrong; it says which, and what would be right.
    """
    from hydra import compose as hydra_compose
    from omegaconf import OmegaConf

    for override in parse(overrides):
        one_value(override)
    with complaints_told(overrides), initialized():
        config = hydra_compose("config", completed(overrides))
        settings: Any = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    if "experiment" in settings:  # there is nothing to be found at this key
        raise UserError("experiment: the first line of the file that is chosen has to be `# @package _global_`")
    return dict(settings)


def as_meant(override: str, several: bool = False) -> str:
    """Rewrites an override so that Hydra reads it as the user meant it.

    `name`, `spec`, `runs_dir` and `policy` (short for `algorithm.policy`) are plain text. With several values, as for
    -m, a comma separates values, unless there is a file of that name. The lists `cases` and `seeds` need no brackets,
    which a shell may take for its own: `cases=tltl_episodic`, `seeds=7,8` and, as in Python, `seeds=7,` for the list
    of one. With several values that holds of `cases` alone: `seeds=7,8` is then an experiment of 7 and one of 8 seeds.
    """
    key, separator, value = override.partition("=")
    name = key.lstrip("+")
    if not separator:
        return override
    if name in TEXTS:
        if several and re.fullmatch(r"(choice|glob|shuffle|sort)\(.*\)", value):
            return override
        parts = value.split(",") if several and not user_path(value).exists() else [value]
        own = "algorithm.policy" if name == "policy" else key
        return f"{own}={','.join(map(_text, parts))}"
    if name.startswith("task.signals.") and not re.match(r"\[|(choice|glob|shuffle|sort)\(", value):
        parts = value.split(",") if several else [value]
        return f"{key}={','.join(map(_text, parts))}"
    words = re.fullmatch(r"\w+(, *\w+)*,?", value)
    if words and (name == "cases" or (name in LISTS and "," in value and not several)):  # with -m: so many seeds each
        return f"{key}=[{value.rstrip(',')}]"
    return override


def _text(value: str) -> str:
    """A value that Hydra reads as this text: in quotes, unless it has them already or needs none."""
    in_quotes = len(value) > 1 and value[0] == value[-1] and value[0] in "'\""
    plain = re.fullmatch(r"[A-Za-z_][\w./-]*", value, flags=re.ASCII) and value.lower() not in WORDS
    return value if in_quotes or plain or "${" in value else quoted(value)


def one_value(override: Any) -> None:
    """Checks that an override, as `parse` gives it, sets its key to one value.

    Raises:
      UserError: if it has several values, which only -m allows.
    """
    if not override.is_sweep_override():
        return
    key = override.get_key_element().lstrip("+")
    value = override.input_line.partition("=")[2]
    if key in GROUPS:
        raise UserError(f"{key}={value}: these are several experiments; write -m {key}={value}")
    written = f"'{key}=[...]'" if "(" in value else f"'{key}=[{value}]'"
    raise UserError(f"{key}={value}: a list is written {written}; several experiments with -m (see --help)")


def completed(overrides: Sequence[str]) -> list[str]:
    """Completes overrides for Hydra; task=NAME without an experiment becomes one that learns the task's spec.

    Raises:
      UserError: if the task is a robot's page with a mistake.
    """
    addable = [_addable(override) for override in overrides]
    given = {key: value for key, _, value in (override.partition("=") for override in overrides)}
    task = given.get("task")
    page = task is not None and is_page(task)
    if page and "experiment" in given:
        raise UserError(f"task={task}: a robot's page needs no experiment; leave out experiment={given['experiment']}")
    if task is None or given.keys() & {"experiment", "~experiment"}:
        return addable
    standing, name = {"name": task}, task
    if page:
        from tltlrl.config import robot  # imports MuJoCo; other mistakes are reported before that
        from tltlrl.tasks.mjcf.file import path_of

        path = path_of(task)
        standing, name = robot.standing(path), robot.offer(path)
    elif task in OUTSIDE:
        if task == "suite" and "task.name" in given:  # as dm_control calls it; the name is that of the kind of task
            addable = [re.sub(r"^task\.name=", "task.id=", override) for override in addable]
            given["task.id"] = given["task.name"]
        standing["name"] = given.get("task.id", task).replace("/", "_")
    elif (spec := spec_of(task)) is not None:
        standing["spec"] = spec
    chosen = ["~experiment", f"+reward={given.get('reward', name)}", f"+task={name}"]  # the last is looked for first
    rest = [override for override in addable if override.partition("=")[0] not in ("task", "reward")]
    return [*chosen, *(f"{key}={quoted(value)}" for key, value in standing.items()), "cases=[tltl_episodic]", *rest]


def spec_of(task: str) -> str | None:
    """The spec that comes with a task, if one does."""
    if task not in TASKS.names():
        return None
    spec: str | None = TASKS.get(task).spec
    return spec


def parse(overrides: Sequence[str]) -> list[Any]:
    """Parses overrides with Hydra; each becomes a hydra.core.override_parser.types.Override.

    Raises:
      UserError: if an override cannot be read, or chooses no file for a group (task=null).
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser

    with complaints_told(overrides):
        parsed = OverridesParser.create().parse_overrides([_addable(override) for override in overrides])
    for override in parsed:
        key = override.key_or_group
        if key in GROUPS and not (
            override.is_delete() or override.is_sweep_override() or isinstance(override.value(), str | list)
        ):
            value = override.get_value_element_as_str()
            raise UserError(f"{key}={value}: there is no such {key}{nearest(value, names(key))}")
    return list(parsed)


def searchpath(config_dir: Path | None) -> list[str]:
    """The overrides that make Hydra look for files in another folder too.

    Raises:
      UserError: if there is no such folder, or a file in it is out of bounds.
    """
    if config_dir is None:
        return []
    if not config_dir.is_dir():
        raise UserError(f"--config-dir {config_dir}: there is no such folder")
    for path in (*config_dir.glob("*.yaml"), *config_dir.glob("*/*.yaml")):  # Hydra would unfold all aliases
        try:
            check_yaml(path)
        except BoundsError as error:
            raise UserError(f"{path}: {error}; delete it, or what makes it so large") from error
    return [f"hydra.searchpath=[{quoted(f'file://{config_dir.resolve()}')}]"]


def quoted(text: str) -> str:
    """Any text, quoted as the value of an override."""
    from hydra.core.override_parser.types import Quote, QuotedString

    return str(QuotedString(text, Quote.double).with_quotes())


def initialized() -> contextlib.AbstractContextManager[Any]:
    """A context in which Hydra is set up with the configs that come with tltlrl."""
    from hydra import initialize_config_dir

    _offer_tasks()
    manager: contextlib.AbstractContextManager[Any] = initialize_config_dir(
        str(CONFIGS), job_name="tltl-run", version_base="1.3"
    )
    return manager


def _offer_tasks() -> None:
    """Adds the tasks of installed packages to Hydra's choices; their defaults are in code, not in configs/."""
    from hydra.core.config_store import ConfigStore

    for name in TASKS.names():
        if name in TASKS.built_in:
            continue
        with contextlib.suppress(Exception):  # reported if the user chooses it
            entry = TASKS.get(name)
            for group, kind in (("task", entry.config), ("reward", entry.reward)):
                ConfigStore.instance().store(name, dataclasses.asdict(kind()), group)


@contextlib.contextmanager
def complaints_told(overrides: Sequence[str]) -> Iterator[None]:
    """Turns Hydra's errors about overrides and the files that they name into a UserError."""
    import yaml
    from hydra.errors import ConfigCompositionException, HydraException, OverrideParseException
    from omegaconf.errors import MissingMandatoryValue, OmegaConfBaseException

    try:
        yield
    except OverrideParseException as error:
        raise UserError(_explain_unreadable(error.override)) from error
    except ConfigCompositionException as error:
        raise UserError(_explain_composition(error, overrides)) from error
    except MissingMandatoryValue as error:
        raise UserError(_explain_missing(str(error.full_key), overrides)) from error
    except (HydraException, OmegaConfBaseException) as error:
        raise UserError(str(error).splitlines()[0]) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"{mark.name}, line {mark.line + 1}: " if mark else ""
        raise UserError(f"{where}it is not YAML: {error.problem}") from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        chosen = ", ".join(override for override in overrides if override.partition("=")[0] in GROUPS)
        raise UserError(f"{chosen}: one of these files, or one that it names, is not text in UTF-8") from error
    except ValueError as error:
        if module_of(error).startswith("omegaconf."):  # a word where a list has numbers
            keys = ", ".join(key for key, *_ in (text.split("=") for text in overrides) if key.count(".") > 1)
            raise UserError(f"{keys}: a list has no such part; give the whole list, as KEY=[a,b]") from error
        if not module_of(error).startswith("hydra."):
            raise
        raise UserError(str(error).splitlines()[0]) from error


def names(group: str) -> list[str]:
    """The choices of a group: files that come with tltlrl, and tasks of installed packages."""
    files = {path.stem for path in (CONFIGS / group).glob("*.yaml")}
    return sorted(files.union(TASKS.names()) if group == "task" else files)


def _addable(override: str) -> str:
    """Puts ++ before a key that the config may lack (a spec's constant, a learner's own, a name), as Hydra wants."""
    return f"++{override}" if OPEN.match(override) else override


def one_seed(value: str | None) -> str:
    """Advice on how to ask for one seed; `seeds=3` asks for three."""
    number = value if value and value.isdecimal() else "3"
    return f"write 'seeds=[{number}]' for the seed {number} alone; seeds={number} is how many, from 0 on"


def _explain_missing(key: str, overrides: Sequence[str]) -> str:
    if key == "spec" and any(override.startswith("task=") for override in overrides):
        return "spec: it has no value; give the .tltl file of what is to be learned, as in spec=my_task.tltl"
    return (
        f"{key}: it has no value; experiment=NAME gives it one (a file of your own for that begins "
        f"with the line `# @package _global_`)"
    )


def _explain_unreadable(override: str) -> str:
    override = override.removeprefix("++")  # which `_addable` may have put there
    if override in names("experiment"):
        return f"{override}: did you mean experiment={override}?"
    if override == "help":
        return "help: did you mean --help?"
    return (
        f"{override}: not readable as key=value; a list is written [1,2,3], text with special characters "
        f"in quotes: key='\"a b\"'"
    )


def _explain_composition(error: Any, overrides: Sequence[str]) -> str:
    options = getattr(error, "options", None)
    if options is not None and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.rpartition("/")
        if group == "task" and name in TASKS.names():
            TASKS.get(name)  # raises the reason why it could not be added
        chosen = [option for option in options if not option.startswith(OFFERED)]  # those have no name for a user
        return f"{group}={name}: there is no such {group}{nearest(name, chosen)}"
    text = str(error)
    if unknown := re.match(r"Could not (?:override|delete from config|append to config)[^']*'([^']+)'", text):
        key = unknown[1]
        if key == "seed":
            return f"seed: no such key; {one_seed(dict(o.split('=', 1) for o in overrides if '=' in o).get('seed'))}"
        return f"{key}: no such key{_nearest_key(key, () if key.startswith('hydra') else _valid_keys(overrides))}"
    if missing := re.match(r"You must specify '(\w+)'", text):
        there = re.findall(r"^\t(\S+)$", text, flags=re.MULTILINE)
        return f"say which {missing[1]}: {missing[1]}=NAME, one of: {', '.join(there)}"
    if merging := re.match(r"Error merging override (\S+)", text):
        return f"{merging[1]}: this key cannot have such a value; --cfg job shows the one it has"
    return text.splitlines()[0]


def _nearest_key(key: str, valid: Collection[str]) -> str:
    """What may have been meant; where no key is near, those of the same section."""
    section = key.rpartition(".")[0]
    told = nearest(key, {*valid} - {section})
    if "did you mean" in told:
        return told
    return nearest(key, {name for name in valid if name.rpartition(".")[0] == section}) or f"; {section} has none"


def _valid_keys(overrides: Sequence[str]) -> set[str]:
    """Every key of the chosen experiment's config, dotted, and the groups; none if it cannot be composed."""
    try:
        config = compose([o for o in overrides if o.partition("=")[0] in (*GROUPS, "spec", "hydra.searchpath")])
    except UserError:
        return set()
    return {*flatten(config), *config, "experiment"}
