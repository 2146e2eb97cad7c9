"""The page of `tltl-run --help`: every key of an experiment's config, its value, and what it means."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from tltlrl.config.compose import GROUPS, compose, names, spec_of
from tltlrl.config.keys import KEYS, sections
from tltlrl.config.read import case_of
from tltlrl.registry import LEARNERS, TASKS
from tltlrl.resources import SPECS

WIDTH = 96
SHOWN = (*GROUPS, "cases", "spec", "hydra.searchpath")  # keys that the page depends on

USAGE = """\
tltl-run: learn a robot task from its temporal-logic spec, and compare rewards over seeds.

  tltl-run experiment=NAME [key=value ...]
  tltl-run task=NAME spec=FILE [key=value ...]
  tltl-run task=ROBOT.yaml spec=FILE [key=value ...]

Examples
  tltl-run experiment=reach_avoid
  tltl-run experiment=reach_avoid name=mine spec=my_task.tltl cases=tltl_episodic
  tltl-run experiment=reach_avoid name=small seeds=7, algorithm.samples=30 reward.goal=3

Any key of the config below can be set as key=value; a list is written [1,2,3], without spaces.
Constants of the spec are set with constants.NAME=value. To start from a learned policy's motion:
policy=runs/NAME/CASE/seed_0/policy.npz. The results go to <runs_dir>/<name>;
the same command again finishes what is missing there. Ctrl-C keeps what is done.

{experiments}
{tasks}
{specs}

Keys and their values for {shown} (another one's: --help experiment=NAME):

{config}
Options
  --from MANIFEST    repeat an experiment: --from runs/NAME/manifest.json name=again
  --cfg job          print the config with your overrides, and stop
  -m                 one experiment per combination: -m algorithm.epsilon=0.2,0.5 seeds=2
  --config-dir DIR   look for experiments, tasks, rewards and algorithms of your own in DIR, too
  --version          print the version of tltlrl
  --help             this page

Exit codes: 0 done; 1 a run failed; 2 the command, config or spec has to be corrected; 130 Ctrl-C.
"""


def usage(overrides: Sequence[str]) -> str:
    """The help page, for the experiment or task among the overrides, if there is one."""
    experiments = names("experiment")
    chosen = [override for override in overrides if override.partition("=")[0] in SHOWN]
    given = dict(override.split("=", 1) for override in chosen)
    shown = next((f"{group}={given[group]}" for group in ("experiment", "task") if group in given), None)
    if shown is None:
        shown = f"experiment={experiments[0]}"
        chosen.append(shown)
    elif shown.startswith("task=") and "spec" not in given and spec_of(given["task"]) is None:
        chosen.append("spec=my_task.tltl")
    return USAGE.format(
        experiments=_listed("Experiments", experiments),
        tasks=_listed("Tasks", names("task")),
        specs=_listed("Specs that come with tltlrl", [path.name for path in sorted(SPECS.glob("*.tltl"))]),
        shown=shown,
        config="".join(f"  {line}\n" for line in _described(compose(chosen))),
    )


def _listed(what: str, members: Sequence[str]) -> str:
    return "\n".join(_wrapped(", ".join(members), "  ", f"{what}: "))


def _described(settings: Mapping[str, Any]) -> list[str]:
    entry = TASKS.get(settings["task"]["name"])
    learners = {case_of(str(case), entry.hand_made).learner for case in settings["cases"]}
    own = {key: value for name in learners for key, value in asdict(LEARNERS.get(name).Settings()).items()}
    within = sections(settings["task"]["name"], learners)
    lines = []
    for name, value in settings.items():
        meaning = KEYS[name].setting.meaning
        if name not in within:
            lines += _line(name, value, meaning)
            continue
        lines.append(f"{name}:  # {meaning}")
        more = {key: own[key] for key in own if key not in value} if name == "algorithm" else {}
        for key, its in (value | more).items():
            about = within[name][key].meaning if key in within[name] else None
            lines += [f"  {line}" for line in _line(key, its, about)]
    return lines


def _line(key: str, value: Any, meaning: str | None) -> list[str]:
    """The lines of a key as YAML, with its meaning beside it, or above if there is no room."""
    import yaml

    flow = None if isinstance(value, list | dict) else False  # None: only the innermost lists in one line
    first, *more = yaml.safe_dump({key: value}, default_flow_style=flow, width=76).splitlines()
    if meaning is None:
        return [first, *more]
    beside = f"{first:<29}  # {meaning}"
    return [beside, *more] if len(beside) <= WIDTH else [*_wrapped(meaning, "# "), first, *more]


def _wrapped(text: str, indent: str, first: str | None = None) -> list[str]:
    """Lines of a text that fit, two of the widest indents allowed for."""
    begin = indent if first is None else first
    return textwrap.wrap(text, WIDTH - 4, initial_indent=begin, subsequent_indent=indent, break_on_hyphens=False)
