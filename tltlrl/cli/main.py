"""The commands `tltl-run` and `tltl`: arguments in, results and messages out, nothing computed here.

What takes time to import is imported by the functions that need it: Ctrl-C is answered from the start.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import tltlrl
from tltlrl.config.compose import GROUPS, compose, searchpath
from tltlrl.errors import UserError


def run_main() -> None:
    """The command `tltl-run`."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """`tltl-run ARGUMENTS`; its exit code."""
    return _told("tltl-run", arguments, lambda: _run(arguments))


def _run(arguments: list[str]) -> int:
    chosen = _options(arguments)
    if chosen.help:
        from tltlrl.config.usage import usage

        print(usage([*searchpath(chosen.config_dir), *chosen.overrides]), end="")
        return 0
    if chosen.version:
        print(_version())
        return 0
    os.environ.setdefault("MUJOCO_GL", "disable")  # nothing here renders, and looking for a renderer takes a second
    command = ["tltl-run", *arguments]
    if chosen.manifest is not None and (chosen.multirun or chosen.config_dir):
        raise UserError("--from: it repeats one experiment, as its manifest says; leave out -m and --config-dir")
    overrides = [*searchpath(chosen.config_dir), *chosen.overrides]
    if chosen.multirun:
        if chosen.cfg:
            raise UserError("--cfg job: it shows the config of one experiment; leave out -m")

        from tltlrl.experiments.multirun import run_combinations

        # Ctrl-C is not told for each: it ends them all
        return run_combinations(overrides, lambda config: _mistakes_told("tltl-run", lambda: _start(config, command)))
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
        run_experiment,  # pandas and matplotlib take a second that a mistake need not wait
    )

    return 0 if run_experiment(study, machinery, command) else 1


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> Any:
        """Told like any other mistake, without a usage that lists nothing of the config."""
        raise UserError(f"{message} (see --help)")


def _options(arguments: list[str]) -> argparse.Namespace:
    """The options, wherever they stand, and the overrides.

    Raises:
      UserError: if there is no such option, with the override that was meant.
    """
    parser = _Parser("tltl-run", add_help=False, allow_abbrev=False)
    parser.add_argument("--help", "-h", action="store_true")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--from", dest="manifest", nargs="?", const="")
    parser.add_argument("--cfg")
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=Path)
    parser.add_argument("overrides", nargs="*")
    chosen, unknown = parser.parse_known_intermixed_args(arguments)
    if unknown:
        _refuse(unknown[0], arguments)
    if chosen.cfg not in (None, "job"):
        raise UserError(f"--cfg {chosen.cfg}: it can only be --cfg job")
    return chosen


def _refuse(option: str, arguments: list[str]) -> None:
    """Says what to write in place of an option that does not exist."""
    from tltlrl.config.keys import KEYS

    flag, _, value = option.partition("=")
    key = flag.lstrip("-").replace("-", "_")
    if key.split(".")[0] not in (*KEYS, *GROUPS):
        raise UserError(f"{flag}: no such option; there are: --from, --cfg, -m, --config-dir, --version, --help")
    following = arguments[arguments.index(option) + 1 :][:1]
    raise UserError(f"{flag}: no such option; write {key}={value or ''.join(following)} (see --help)")


def _version() -> str:
    return f"tltlrl {tltlrl.__version__}"


def main(arguments: list[str] | None = None) -> None:
    """The command `tltl`."""
    given = sys.argv[1:] if arguments is None else arguments
    sys.exit(_told("tltl", given, lambda: _tltl(given)))


def _tltl(arguments: list[str]) -> int:
    from tltlrl.cli import check

    parser = argparse.ArgumentParser("tltl", description="Check specs; evaluate, render and plot what was learned.")
    parser.add_argument("--version", action="version", version=_version())
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
    return int(chosen.command(chosen))


def _evaluate(arguments: argparse.Namespace) -> int:
    import numpy as np
    from scipy.stats import binomtest

    from tltlrl.experiments.experiment import open_run
    from tltlrl.training.study import MOST_TRIALS
    from tltlrl.training.verdict import try_policy

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
    from tltlrl.experiments.experiment import open_run
    from tltlrl.reports.video import render_motion
    from tltlrl.reports.workspace import draw_workspace
    from tltlrl.store.layout import WORKSPACE
    from tltlrl.training.build import make_task

    run, policy = open_run(arguments.run)
    folder = arguments.output or arguments.run
    folder.mkdir(parents=True, exist_ok=True)
    if make_task(run.task).skeleton is not None:
        draw_workspace(run, policy, folder / WORKSPACE)
        print(f"{folder}/{WORKSPACE}.png, .pdf: the paths")
    render_motion(run, policy, folder / "motion")
    print(f"{folder}/motion.gif: the motion; motion.png: frames of it")
    return 0


def _plot(arguments: argparse.Namespace) -> int:
    from tltlrl.reports.plotting import plot_learning_curves, read_curves

    output = arguments.output or arguments.experiments[0] / "learning_curves"
    plot_learning_curves([read_curves(folder) for folder in arguments.experiments], output)
    print(f"{output}.png, {output}.pdf")
    return 0


def _search(arguments: argparse.Namespace) -> int:
    from tltlrl.config.read import read
    from tltlrl.experiments.search import (
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
    fixed, space, distributions = parse_space([*searchpath(arguments.config_dir), *arguments.overrides])

    def configure(parameters: Mapping[str, Any]) -> dict[str, Any]:
        return compose([*fixed, *(f"{key}={value}" for key, value in parameters.items())])

    search = Search(*read(configure({})), tuple(fixed), space, distributions, configure, arguments.seed)
    table = run_search(search, arguments.trials, ["tltl", *sys.argv[1:]])
    ranked, failed = best_first(table), failures(table)
    if failed:
        print(f"{len(failed)} of {len(table)} trials failed; {search.folder}/summary.md says why")
    if ranked:
        found = describe({key: ranked[0][key] for key in space})
        print(f"best: trial {ranked[0]['number']}, {found}: robustness {ranked[0]['objective']:+.4f}")
        print(f"at the experiment's own budget and seeds: {best_command(search, ranked[0])}")
    return 1 if failed else 0


def _repeated(manifest: str, overrides: Sequence[str]) -> dict[str, Any]:
    """The config of a manifest.json with other values for some keys."""
    import yaml
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    from tltlrl.experiments.manifest import settings_of

    if not manifest:
        raise UserError("--from: give the manifest.json of an experiment, as in --from runs/NAME/manifest.json")
    settings = settings_of(Path(manifest))
    try:
        changes = OmegaConf.from_dotlist([override.lstrip("+") for override in overrides])
        changed: Any = OmegaConf.to_container(OmegaConf.merge(settings, changes))
    except (OmegaConfBaseException, yaml.YAMLError) as error:
        raise UserError(f"--from: {str(error).splitlines()[0]}") from error
    return dict(changed)


def _told(name: str, arguments: list[str], command: Callable[[], int]) -> int:
    """Runs a command; what its user has to mend becomes one message and exit code 2, Ctrl-C one and 130."""
    try:
        return _mistakes_told(name, command)
    except KeyboardInterrupt:
        without = " without overwrite=true" if "overwrite=true" in arguments else ""
        print(f"{name}: stopped; the same command{without} goes on from what is done", file=sys.stderr)
        return 130


def _mistakes_told(name: str, command: Callable[[], int]) -> int:
    try:
        return command()
    except BrokenPipeError:  # whoever read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (UserError, MemoryError) as error:
        print(f"{name}: {error}", file=sys.stderr)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        print(
            f"{name}: {where}{error.strerror or error}; see to the disk or the folder and start the command again: "
            "what is done is kept",
            file=sys.stderr,
        )
    except Exception as error:
        from tltlrl.logic import SpecError, TraceError

        if not isinstance(error, SpecError | TraceError):
            raise
        print(f"{name}: {error}", file=sys.stderr)
    return 2
