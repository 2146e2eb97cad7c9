"""The commands `tltl-run` and `tltl`: arguments in, results and messages out, nothing computed here."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tltlrl import check
from tltlrl.errors import UserError, nearest
from tltlrl.resources import CONFIGS, SPECS
from tltlrl.spec import SpecError, TraceError

MOST_TRIALS = 10_000  # they are one batch

USAGE = """\
tltl-run: learn a robot task from its temporal-logic spec, and compare rewards over seeds.

  tltl-run experiment=NAME [key=value ...]

Examples
  tltl-run experiment=reach_avoid
  tltl-run experiment=reach_avoid name=mine spec=my_task.tltl cases=[tltl_episodic]
  tltl-run experiment=reach_avoid name=small seeds=[7] algorithm.samples=30 reward.goal=3

Any key of the config below can be set as key=value; a list is written [1,2,3], without spaces.
Constants of the spec are set with constants.NAME=value. The results go to <runs_dir>/<name>;
the same command again finishes what is missing there. Ctrl-C keeps what is done.

Experiments: {experiments}
Specs that come with tltlrl: {specs}

Keys and their values for experiment={shown}:

{config}
Options
  --from MANIFEST    repeat an experiment: --from runs/NAME/manifest.json name=again
  --cfg job          print the config with your overrides, and stop
  -m                 one experiment per combination: -m algorithm.epsilon=0.2,0.5 seeds=2
  --config-dir DIR   look for experiments, tasks, rewards and algorithms of your own in DIR, too
  --help             this page

Exit codes: 0 done; 1 a run failed; 2 the command, config or spec has to be mended; 130 Ctrl-C.
"""


def run_main() -> None:
    """The command `tltl-run`."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """`tltl-run ARGUMENTS`; its exit code."""
    if "--help" in arguments or "-h" in arguments:
        print(usage(), end="")
        return 0
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing here renders, and looking for a renderer takes a second
    if arguments[:1] == ["--from"]:
        return _told("tltl-run", lambda: _repeat(arguments))
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra raises what goes wrong, and it is told below
    sys.argv = ["tltl-run", *(_addable(argument) for argument in arguments)]
    return _told("tltl-run", lambda: _hydra_run(arguments))


def main(arguments: list[str] | None = None) -> None:
    """The command `tltl`."""
    parser = argparse.ArgumentParser("tltl", description="Check specs; evaluate, render and plot what was learned.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    check.add_parser(commands)

    evaluate = commands.add_parser("evaluate", help="trials of a learned policy and their success rate")
    evaluate.add_argument("run", type=Path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    evaluate.add_argument("--trials", type=int, default=10, help="how many (default 10, as in the case study)")
    evaluate.add_argument("--seed", type=int, default=0, help="of the actuators' noise (default 0)")
    evaluate.set_defaults(command=_evaluate)

    render = commands.add_parser("render", help="a picture of the workspace with the learned paths, and a video")
    render.add_argument("run", type=Path, metavar="RUN", help="for instance runs/reach_avoid/tltl_episodic/seed_0")
    render.add_argument("--output", type=Path, help="a folder for them (default RUN)")
    render.set_defaults(command=_render)

    plot = commands.add_parser("plot", help="the learning curves of one or more experiments, from their CSV files")
    plot.add_argument("experiments", type=Path, nargs="+", metavar="EXPERIMENT", help="for instance runs/reach_avoid")
    plot.add_argument("--output", type=Path, help="where to, without suffix (default EXPERIMENT/learning_curves)")
    plot.set_defaults(command=_plot)

    search = commands.add_parser("search", help="the best values of a few keys of an experiment, by Optuna")
    search.add_argument(
        "overrides",
        nargs="+",
        metavar="KEY=VALUE",
        help="as for tltl-run; searched: 'KEY=interval(0,0.4)', KEY=a,b ...",
    )
    search.add_argument(
        "--trials", type=int, default=30, help="how many in all, those done before included (default 30)"
    )
    search.add_argument("--seed", type=int, default=0, help="of the choice of trials (default 0)")
    search.add_argument("--config-dir", type=Path, metavar="DIR", help="look for configs of your own in DIR, too")
    search.set_defaults(command=_search)

    chosen = parser.parse_args(arguments)
    sys.exit(_told("tltl", lambda: chosen.command(chosen)))


def _evaluate(arguments: argparse.Namespace) -> int:
    import numpy as np
    from scipy.stats import binomtest

    from tltlrl.experiment import open_run
    from tltlrl.training import try_policy

    if not 1 <= arguments.trials <= MOST_TRIALS or arguments.seed < 0:
        raise UserError(f"--trials must lie between 1 and {MOST_TRIALS}, and --seed be at least 0")
    run, policy = open_run(arguments.run)
    tried = try_policy(run, policy, arguments.trials, np.random.default_rng(arguments.seed))
    for trial, why in enumerate(run.spec.explain(tried.signals, tried.lengths)):
        judged = "".join(f"; {name}: {'yes' if values[trial] else 'no'}" for name, values in tried.outcomes.items())
        print(f"trial {trial}: robustness {why.value:+.4f}, {why.verdict}; decided {why.decided_by}{judged}")
    for name, successes in {"success": tried.robustness > 0, **tried.outcomes}.items():
        count = int(np.sum(successes))
        interval = binomtest(count, arguments.trials).proportion_ci(method="wilson")
        print(
            f"{name} rate {count}/{arguments.trials} = {count / arguments.trials:.2f} "
            f"(95 % Wilson interval {interval.low:.2f} to {interval.high:.2f})"
        )
    return 0


def _render(arguments: argparse.Namespace) -> int:
    from tltlrl.experiment import open_run
    from tltlrl.video import render_motion
    from tltlrl.workspace import WORKSPACE, draw_workspace, drawable

    run, policy = open_run(arguments.run)
    folder = arguments.output or arguments.run
    folder.mkdir(parents=True, exist_ok=True)
    if drawable(run.task):
        draw_workspace(run, policy, folder / WORKSPACE)
        print(f"{folder}/{WORKSPACE}.png, .pdf: the paths")
    render_motion(run, policy, folder / "motion")
    print(f"{folder}/motion.gif: the motion; motion.png: frames of it")
    return 0


def _plot(arguments: argparse.Namespace) -> int:
    from tltlrl.plotting import plot_learning_curves, read_curves

    output = arguments.output or arguments.experiments[0] / "learning_curves"
    plot_learning_curves([read_curves(folder) for folder in arguments.experiments], output)
    print(f"{output}.png, {output}.pdf")
    return 0


def _search(arguments: argparse.Namespace) -> int:
    from tltlrl.config import experiment_from
    from tltlrl.search import (
        Search,
        best_command,
        best_first,
        describe,
        failures,
        parse_space,
        require_optuna,
        run_search,
    )

    os.environ.setdefault("MUJOCO_GL", "disable")
    require_optuna()
    with _hydra_errors_told(arguments.overrides):
        fixed, space, distributions = parse_space(arguments.overrides)
    if arguments.config_dir:
        fixed.insert(0, f"hydra.searchpath=[file://{arguments.config_dir.resolve()}]")

    def configure(parameters: Mapping[str, Any]) -> dict[str, Any]:
        overrides = [*fixed, *(f"{key}={value}" for key, value in parameters.items())]
        with _hydra_errors_told(overrides):
            return compose([_addable(override) for override in overrides])

    search = Search(experiment_from(configure({})), tuple(fixed), space, distributions, configure, arguments.seed)
    table = run_search(search, arguments.trials, ["tltl", *sys.argv[1:]])
    ranked, failed = best_first(table), failures(table)
    if failed:
        print(f"{len(failed)} of {len(table)} trials failed; {search.folder}/summary.md says why")
    if ranked:
        found = describe({key: ranked[0][key] for key in space})
        print(f"best: trial {ranked[0]['number']}, {found}: robustness {ranked[0]['objective']:+.4f}")
        print(f"at the experiment's own budget and seeds: {best_command(search, ranked[0])}")
    return 1 if failed else 0


def _addable(argument: str) -> str:
    """Hydra wants ++ before a key that the config does not have yet, as any constant of a spec."""
    return f"++{argument}" if argument.startswith("constants.") else argument


def _repeat(arguments: list[str]) -> int:
    """`--from MANIFEST [key=value ...]`: the experiment of a manifest.json, with other values for some keys."""
    import yaml
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    from tltlrl.config import experiment_from
    from tltlrl.manifest import settings_of

    if len(arguments) < 2:
        raise UserError("--from: give the manifest.json of an experiment, as in --from runs/NAME/manifest.json")
    settings = settings_of(Path(arguments[1]))
    try:
        changed: Any = OmegaConf.merge(settings, OmegaConf.from_dotlist(arguments[2:]))
    except (OmegaConfBaseException, yaml.YAMLError) as error:
        raise UserError(f"--from: {str(error).splitlines()[0]}") from error
    experiment = experiment_from(OmegaConf.to_container(changed))  # type: ignore[arg-type]

    from tltlrl.experiment import run_experiment

    return 0 if run_experiment(experiment, ["tltl-run", *arguments]) else 1


def _module_of(error: Exception) -> str:
    """Where it was raised."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    return str(frame.f_globals["__name__"])


class _FailedElsewhere(Exception):
    """An experiment of -m did not succeed in a process of hydra/launcher=...; its message was printed there."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


def _hydra_run(arguments: list[str]) -> int:
    import hydra

    codes: list[int] = []
    here = os.getpid()

    def job(config: Any) -> None:  # Ctrl-C is not told here: it ends every job of a multirun
        code = _mistakes_told("tltl-run", lambda: _run(config, arguments))
        codes.append(code)
        if code and os.getpid() != here:  # a launcher's process, whose `codes` is a copy
            raise _FailedElsewhere(code)

    try:
        with _hydra_errors_told(arguments):
            hydra.main(version_base="1.3", config_path=str(CONFIGS), config_name="config")(job)()
    except _FailedElsewhere as error:  # Hydra has printed the overrides of that experiment
        print("tltl-run: it failed in its job, and others may have; the jobs' logs say why", file=sys.stderr)
        return error.code
    except Exception as error:
        if not _module_of(error).startswith("submitit."):
            raise
        print(f"tltl-run: hydra/launcher reports: {error}", file=sys.stderr)
        return 1
    return max(codes, default=0)


@contextlib.contextmanager
def _hydra_errors_told(arguments: list[str]) -> Iterator[None]:
    """What Hydra finds wrong with the arguments, in the words of these commands."""
    from hydra.errors import ConfigCompositionException, HydraException, OverrideParseException

    try:
        yield
    except OverrideParseException as error:
        raise UserError(
            f"{error.override}: not readable as key=value; a list is written [1,2,3], text with special characters "
            f"in quotes: key='\"a b\"'"
        ) from error
    except ConfigCompositionException as error:
        raise UserError(_explain_composition(error, arguments)) from error
    except HydraException as error:
        raise UserError(str(error).splitlines()[0]) from error


def _run(config: Any, arguments: list[str]) -> int:
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    from tltlrl.config import experiment_from

    try:
        settings: Any = OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise UserError(str(error).splitlines()[0]) from error
    job = HydraConfig.get()
    if job.mode == RunMode.MULTIRUN:  # or every combination would ask for the same folder
        settings["name"] += "," + job.job.override_dirname.replace("/", "-")
    experiment = experiment_from(settings)

    from tltlrl.experiment import run_experiment  # pandas and matplotlib take a second that a mistake need not wait

    return 0 if run_experiment(experiment, ["tltl-run", *arguments]) else 1


def _explain_composition(error: Any, arguments: list[str]) -> str:
    """What Hydra found wrong, in the words of this command."""
    options = getattr(error, "options", None)
    if options is not None and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.rpartition("/")
        return f"{group}={name}: there is no such {group}{nearest(name, options)}"
    if unknown := re.match(r"Could not (?:override|delete from config|append to config)[^']*'([^']+)'", str(error)):
        key = unknown[1]
        return f"{key}: no such key{nearest(key, _valid_keys(arguments))}"
    if missing := re.match(r"You must specify '(\w+)'", str(error)):
        return f"say which {missing[1]}: {missing[1]}=NAME, one of: {', '.join(_names(missing[1]))}"
    return str(error)


def _valid_keys(arguments: list[str]) -> list[str]:
    """Every key of the chosen experiment's config, dotted, and the groups."""
    groups = [a for a in arguments if a.split("=")[0] in {p.name for p in CONFIGS.iterdir() if p.is_dir()}]
    try:
        config = compose(groups)
    except Exception:
        return []
    from tltlrl.experiment import flatten

    return [*flatten(config), *config, "experiment"]


def compose(overrides: list[str]) -> dict[str, Any]:
    """The config of these overrides as plain data."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_dir
    from omegaconf import OmegaConf

    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        result: Any = OmegaConf.to_container(hydra_compose("config", overrides), resolve=True)
    return dict(result)


def usage() -> str:
    """The text of --help."""
    import yaml

    experiments = _names("experiment")
    shown = experiments[0]
    config = yaml.safe_dump(compose([f"experiment={shown}"]), sort_keys=False, default_flow_style=None, width=76)
    return USAGE.format(
        experiments=", ".join(experiments),
        specs=", ".join(path.name for path in sorted(SPECS.glob("*.tltl"))),
        shown=shown,
        config="".join(f"  {line}\n" for line in config.splitlines()),
    )


def _names(group: str) -> list[str]:
    return sorted(path.stem for path in (CONFIGS / group).glob("*.yaml"))


def _told(name: str, command: Callable[[], int]) -> int:
    """Runs a command; what its user has to mend becomes one message and exit code 2, Ctrl-C one and 130."""
    try:
        return _mistakes_told(name, command)
    except KeyboardInterrupt:
        without = " without overwrite=true" if "overwrite=true" in sys.argv else ""
        print(f"{name}: stopped; the same command{without} goes on from what is done", file=sys.stderr)
        return 130


def _mistakes_told(name: str, command: Callable[[], int]) -> int:
    try:
        return command()
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (UserError, SpecError, TraceError, MemoryError) as error:
        print(f"{name}: {error}", file=sys.stderr)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        print(
            f"{name}: {where}{error.strerror or error}; see to the disk or the folder and start the command again: "
            "what is done is kept",
            file=sys.stderr,
        )
    return 2
