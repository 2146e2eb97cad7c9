"""The page of `tltl-run --help`: every key of an experiment's config, its value, and what configs/ says it means."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tltlrl.config.compose import GROUPS, compose, names
from tltlrl.resources import CONFIGS, SPECS

WIDTH = 96

USAGE = """\
tltl-run: learn a robot task from its temporal-logic spec, and compare rewards over seeds.

  tltl-run experiment=NAME [key=value ...]

Examples
  tltl-run experiment=reach_avoid
  tltl-run experiment=reach_avoid name=mine spec=my_task.tltl 'cases=[tltl_episodic]'
  tltl-run experiment=reach_avoid name=small 'seeds=[7]' algorithm.samples=30 reward.goal=3

Any key of the config below can be set as key=value; a list is written [1,2,3], without spaces.
Constants of the spec are set with constants.NAME=value. The results go to <runs_dir>/<name>;
the same command again finishes what is missing there. Ctrl-C keeps what is done.

Experiments: {experiments}
Specs that come with tltlrl: {specs}

Keys and their values for experiment={shown} (--help experiment=NAME shows another one's):

{config}
Options
  --from MANIFEST    repeat an experiment: --from runs/NAME/manifest.json name=again
  --cfg job          print the config with your overrides, and stop
  -m                 one experiment per combination: -m algorithm.epsilon=0.2,0.5 seeds=2
  --config-dir DIR   look for experiments, tasks, rewards and algorithms of your own in DIR, too
  --version          of tltlrl
  --help             this page

Exit codes: 0 done; 1 a run failed; 2 the command, config or spec has to be mended; 130 Ctrl-C.
"""


def usage(overrides: Sequence[str]) -> str:
    """The page; of the experiment among the overrides, if there is one."""
    experiments = names("experiment")
    chosen = [override for override in overrides if override.partition("=")[0] in (*GROUPS, "hydra.searchpath")]
    named = [override.partition("=")[2] for override in chosen if override.startswith("experiment=")]
    shown = named[-1] if named else experiments[0]
    settings = compose(chosen if named else [*chosen, f"experiment={shown}"])
    return USAGE.format(
        experiments=", ".join(experiments),
        specs=", ".join(path.name for path in sorted(SPECS.glob("*.tltl"))),
        shown=shown,
        config="".join(f"  {line}\n" for line in _described(settings)),
    )


def _described(settings: Mapping[str, Any]) -> list[str]:
    meanings = _comments(CONFIGS / "config.yaml")
    lines = []
    for key, value in settings.items():
        if key not in GROUPS:
            lines += _line(key, value, meanings.get(key))
            continue
        files = sorted((CONFIGS / key).glob("*.yaml"))  # that of this task knows best what its keys mean here
        files = [path for path in files if path.stem == settings["task"]["name"]] or files
        of_its_keys = {name: comment for path in files for name, comment in _comments(path).items()}
        lines += [f"{key}:" + (f"  # {meanings[key]}" if key in meanings else "")]
        lines += [f"  {line}" for name in value for line in _line(name, value[name], of_its_keys.get(name))]
    return lines


def _line(key: str, value: Any, comment: str | None) -> list[str]:
    """A key as YAML, with its comment beside it or, where there is no room, above."""
    import yaml

    flow = None if isinstance(value, list | dict) else False  # None: only the innermost lists in one line
    first, *more = yaml.safe_dump({key: value}, default_flow_style=flow, width=76).splitlines()
    if comment is None:
        return [first, *more]
    beside = f"{first:<29}  # {comment}"
    return [beside, *more] if len(beside) <= WIDTH else [f"# {comment}", first, *more]


def _comments(path: Path) -> dict[str, str]:
    """Key => the comment beside it in a config file."""
    return dict(re.findall(r"^(\w+):.*? # (.*)$", path.read_text(encoding="utf-8"), flags=re.MULTILINE))
