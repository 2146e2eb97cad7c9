"""`tltl search KEY=VALUE ...`: the best values of a few keys of an experiment, by Optuna."""

from __future__ import annotations

import functools
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from typing import Any

from tltlrl.config.compose import as_meant, compose, searchpath
from tltlrl.resources import user_path


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl search`."""
    parser.add_argument(
        "overrides",
        nargs="+",
        metavar="KEY=VALUE",
        help="as for tltl-run; searched: 'KEY=interval(0,0.4)', KEY=a,b ...",
    )
    parser.add_argument(
        "--trials", type=int, default=30, help="candidates in all, including those done before (default 30)"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed by which candidates are chosen (default 0)")
    parser.add_argument("--config-dir", type=user_path, metavar="DIR", help="look for configs of your own in DIR, too")


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError, SpecError: what the user has to mend.
    """
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

    require_optuna()
    fixed, space, distributions = parse_space([*searchpath(arguments.config_dir), *map(as_meant, arguments.overrides)])

    @functools.cache  # a candidate is asked for when it is proposed, run and judged
    def composed(*searched: str) -> dict[str, Any]:
        return compose([*fixed, *searched])

    def configure(parameters: Mapping[str, Any]) -> dict[str, Any]:
        return composed(*(f"{key}={value}" for key, value in parameters.items()))

    study, machinery = read(configure({}))
    asked = Search(study, machinery, tuple(fixed), space, distributions, configure, arguments.seed)
    table = run_search(asked, arguments.trials, ["tltl", *sys.argv[1:]])
    ranked, failed = best_first(table), failures(table)
    if failed:
        print(f"{len(failed)} of {len(table)} candidates failed; {asked.folder}/summary.md says why")
    if ranked:
        found = describe({key: ranked[0][key] for key in space})
        print(f"best: candidate {ranked[0]['number']}, {found}: robustness {ranked[0]['objective']:+.4f}")
        print(f"at the experiment's own budget and seeds: {best_command(asked, ranked[0])}")
    return 1 if failed else 0
