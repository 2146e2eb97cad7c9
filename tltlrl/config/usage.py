"""The page of `tltl-run --help`: every key of an experiment's config, its value, and what it means."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tltlrl.config.compose import GROUPS, compose, names
from tltlrl.config.keys import KEYS, EngineConfig, algorithm_settings
from tltlrl.registry import TASKS
from tltlrl.resources import SPECS
from tltlrl.settings import settings_of
from tltlrl.tasks.task import TaskEntry

WIDTH = 96

USAGE = """\
tltl-run: learn a robot task from its temporal-logic spec, and compare rewards over seeds.

  tltl-run experiment=NAME [key=value ...]
  tltl-run task=NAME spec=FILE [key=value ...]

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
    entry: TaskEntry = TASKS.get(settings["task"]["name"])
    sections = {
        "task": settings_of(entry.config),
        "reward": settings_of(entry.reward),
        "algorithm": algorithm_settings(()),
        "engine": settings_of(EngineConfig),
    }
    lines = []
    for key, value in settings.items():
        if key not in sections:
            lines += _line(key, value, KEYS[key].meaning)
            continue
        lines.append(f"{key}:  # {KEYS[key].meaning}")
        meanings = {name: own.meaning for name, own in sections[key].items()}
        lines += [f"  {line}" for name in value for line in _line(name, value[name], meanings.get(name))]
    return lines


def _line(key: str, value: Any, meaning: str | None) -> list[str]:
    """A key as YAML, with its meaning beside it or, where there is no room, above."""
    import yaml

    flow = None if isinstance(value, list | dict) else False  # None: only the innermost lists in one line
    first, *more = yaml.safe_dump({key: value}, default_flow_style=flow, width=76).splitlines()
    if meaning is None:
        return [first, *more]
    beside = f"{first:<29}  # {meaning}"
    return [beside, *more] if len(beside) <= WIDTH else [f"# {meaning}", first, *more]
