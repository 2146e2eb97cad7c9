"""`tltl search`: the best values of a few keys of a config, asked for by Optuna and answered by ordinary experiments.

It is a command of its own, because `tltl-run` has no candidates, no objective and no best one, and because a search
has no single folder and table of cases. What may be searched is written in Hydra's own sweep grammar, as for
`tltl-run -m`: interval(0,0.4), int(interval(2,8)), tag(log,interval(0.1,2)), range(10,50,10), choice(a,b) or a,b.

Candidate k is the experiment `trial_<k>` in the search's folder, so it is resumed like any other. (Optuna calls it a
trial; in this code a trial is one of a learned policy.) Its parameters are a pure function of the search's seed, of k
and of the results before k (`propose`). They enter the journal as one line. So a search that was stopped anywhere
tries the same candidates as one that was not.
"""

from __future__ import annotations

import csv
import io
import math
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from tltlrl.config.compare import differences
from tltlrl.config.compose import parse
from tltlrl.config.keys import KEYS, is_budget
from tltlrl.config.machinery import Machinery
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.experiments.experiment import run_experiment
from tltlrl.experiments.folder import empty, read_record, working_in
from tltlrl.experiments.journal import open_journal, proven
from tltlrl.experiments.results import finished
from tltlrl.experiments.scheduler import check_scheduler
from tltlrl.settings import Role
from tltlrl.store.files import digest, write_text
from tltlrl.store.layout import JOURNAL, LOG, SEARCH, SUMMARY_PAGE, TRIALS
from tltlrl.training.study import Study

if TYPE_CHECKING:
    import optuna
    from optuna.distributions import BaseDistribution
    from optuna.trial import FrozenTrial

MOST_CANDIDATES = 1000

Parameters = Mapping[str, Any]  # key => value; of a choice, its text as in an override
Results = dict[int, list[Mapping[str, Any]]]  # number of a candidate => done.json of each of its runs, if all are whole


@dataclass(frozen=True)
class Search:
    """What is searched, and where.

    Attributes:
      base: the study, with its own values for the searched keys.
      machinery: of the search, and of every candidate.
      fixed: the overrides that made them.
      space: key => what it may be, as written, without spaces.
      distributions: the same for Optuna.
      configure: values of searched keys => the whole config with them.
      seed: of the sampler.
    """

    base: Study
    machinery: Machinery
    fixed: tuple[str, ...]
    space: dict[str, str]
    distributions: dict[str, BaseDistribution]
    configure: Callable[[Parameters], dict[str, Any]]
    seed: int

    @property
    def folder(self) -> Path:
        """Where the candidates' folders, the journal and the tables lie; beside an experiment of the config's name."""
        named = any(override.startswith("name=") for override in self.fixed)
        return self.machinery.folder(self.base.name if named else f"{self.base.name}_search")

    def candidate_folder(self, number: int) -> Path:
        """Where a candidate's results lie, as those of any experiment."""
        return self.folder / f"trial_{number:03d}"

    def candidate(self, number: int, parameters: Parameters) -> tuple[Study, Machinery]:
        """The experiment of a candidate.

        Raises:
          UserError, SpecError: if no experiment can have these values.
        """
        path = self.candidate_folder(number)
        place = {"name": path.name, "runs_dir": str(path.parent), "overwrite": False}
        return read(self.configure(parameters) | place)

    def record(self) -> dict[str, Any]:
        """What the folder is known by, and what must not change in it: search.yaml."""
        return {
            "name": self.base.name,
            "space": self.space,
            "seed": self.seed,
            "config": dict(self.base.settings),
            "spec_sha256": digest(self.base.spec.text.encode()),
        }


def require_optuna() -> None:
    """Imports Optuna, and silences what it says about every trial.

    Raises:
      UserError: if it is not installed.
    """
    try:
        import optuna
    except ImportError as error:
        raise UserError("the search needs Optuna, an extra: pip install 'tltlrl[search]'") from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)


def parse_space(overrides: Sequence[str]) -> tuple[list[str], dict[str, str], dict[str, BaseDistribution]]:
    """Divides overrides into those that are fixed and those that say what may be searched.

    Returns:
      The fixed ones; key => what is searched, as written; key => the same for Optuna.

    Raises:
      UserError: if nothing is searched, or something that cannot be, or an override cannot be read.
    """
    fixed: list[str] = []
    space: dict[str, str] = {}
    distributions: dict[str, BaseDistribution] = {}
    for text, override in zip(overrides, parse(overrides), strict=True):
        if not override.is_sweep_override():
            fixed.append(text)
            continue
        key = override.get_key_element().lstrip("+")
        section = key.split(".")[0]
        if section == "experiment" or (section in KEYS and Role.SEARCHED not in KEYS[section].setting.role):
            raise UserError(
                f"{key}: it cannot be searched; candidates have the same runs, and one spec to be compared by"
            )
        if key in space:
            raise UserError(f"{key}: given twice")
        space[key] = "".join(text.partition("=")[2].split())
        distributions[key] = _distribution(key, space[key], override)
    if not space:
        raise UserError(
            "say what to search, as in 'reward.c2=interval(0,0.4)' or algorithm.covariance=damped,published"
        )
    return fixed, space, distributions


def _distribution(key: str, text: str, override: Any) -> BaseDistribution:
    """Of one parsed override with a sweep as its value."""
    from hydra.core.override_parser.types import ChoiceSweep, IntervalSweep, RangeSweep
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    sweep = override.value()
    if isinstance(sweep, RangeSweep) and not sweep.shuffle:
        values = list(sweep.range())
        if values and sweep.step > 0:
            kind: Any = IntDistribution if isinstance(values[0], int) else FloatDistribution
            distribution: BaseDistribution = kind(values[0], values[-1], step=sweep.step)
            return distribution
    elif isinstance(sweep, IntervalSweep):
        low, high, log = sweep.start, sweep.end, "log" in sweep.tags
        possible = low is not None and high is not None and low < high and (low > 0 or not log)
        if possible and sweep.tags <= {"log"} and math.isfinite(low) and math.isfinite(high):
            return (IntDistribution if isinstance(low, int) else FloatDistribution)(low, high, log=log)
    elif isinstance(sweep, ChoiceSweep) and not sweep.shuffle:
        choices = list(override.sweep_string_iterator())
        if len(set(choices)) == len(choices):
            return CategoricalDistribution(choices)
    raise UserError(
        f"{key}: {text} cannot be searched; there are interval(LOW,HIGH), int(interval(LOW,HIGH)), "
        "tag(log,interval(LOW,HIGH)) with LOW above 0, range(START,STOP,STEP) and choice(A,B)"
    )


def run_search(search: Search, count: int, command: list[str]) -> list[dict[str, Any]]:
    """Does what is missing of the first `count` candidates and writes trials.csv and summary.md.

    Args:
      search: what to do.
      count: candidates in all, those of earlier sessions included.
      command: the command line, for the candidates' manifests.

    Returns:
      The rows of trials.csv.

    Raises:
      UserError: if the folder holds another search, or another process works in it.
    """
    if not 1 <= count <= MOST_CANDIDATES or not 0 <= search.seed < 2**63:
        raise UserError(f"--trials must lie between 1 and {MOST_CANDIDATES}, and --seed be at least 0")
    _check_ours(search)
    _check_space(search)
    if search.machinery.address is not None:
        check_scheduler(search.machinery.address)
    with working_in(search.folder):
        _prepare(search)
        journal = open_journal(search.folder / JOURNAL)
        before = sum(candidate.state.is_finished() for candidate in journal.trials[:count])
        if before:
            _say(f"{before} of {count} candidates were done before and are kept")
        found = _read(search, journal.trials)
        for number in range(count):
            _try(search, journal, found, number, count, command)
        table = table_of(journal.trials, found)
        write_tables(search, table)
    return table


def _read(search: Search, candidates: Sequence[FrozenTrial]) -> Results:
    """What the runs of the finished candidates say; where the journal says something else, that is told."""
    found: Results = {}
    for candidate in candidates:
        if candidate.value is None:
            continue
        runs = results(search, candidate)
        if runs:
            found[candidate.number] = runs
            _tell_change(candidate, objective(runs))
    return found


def _tell_change(candidate: FrozenTrial, value: float) -> None:
    if candidate.value != value:
        _say(
            f"candidate {candidate.number}: robustness {candidate.value:+.4f} by {JOURNAL} and {value:+.4f} by its "
            "runs, which count"
        )


def _try(search: Search, journal: optuna.Study, found: Results, number: int, count: int, command: list[str]) -> None:
    """Does what is missing of one candidate; its results are put into `found`."""
    from optuna.trial import TrialState

    if number == len(journal.trials):  # one line of the journal: all of it or nothing
        journal.add_trial(_begin(search, proven(journal.trials, values_of(found)), number))
    candidate = journal.trials[number]
    if candidate.state == TrialState.FAIL or number in found:
        return
    _say(f"candidate {number} ({number + 1} of {count}): {describe(candidate.params)}")
    succeeded = run_experiment(*search.candidate(number, candidate.params), command)
    runs = results(search, candidate) if succeeded else []
    value = objective(runs)
    if math.isfinite(value):
        found[number] = runs
    if candidate.state.is_finished():  # its folder was gone, and has come back
        if number in found:
            _tell_change(candidate, value)
    elif number in found:
        journal.tell(number, value)
        _say(f"candidate {number}: robustness {value:+.4f}; best so far {max(values_of(found).values()):+.4f}")
    else:
        journal.tell(number, state=TrialState.FAIL)
        _say(f"candidate {number} FAILED; see {search.candidate_folder(number)}")
    write_tables(search, table_of(journal.trials, found))


def _begin(search: Search, earlier: Sequence[FrozenTrial], number: int) -> FrozenTrial:
    """The next candidate: to be run, or failed already if there is no experiment with its parameters."""
    from optuna.trial import TrialState, create_trial

    parameters = propose(search.distributions, earlier, search.seed, number)
    state, attributes = TrialState.RUNNING, {}
    try:
        search.candidate(number, parameters)
    except UserError as error:
        state, attributes = TrialState.FAIL, {"message": str(error)}
        _say(f"candidate {number}: {describe(parameters)} FAILED: {error}")
    return create_trial(state=state, params=dict(parameters), distributions=search.distributions, user_attrs=attributes)


def propose(
    distributions: Mapping[str, BaseDistribution], earlier: Sequence[FrozenTrial], seed: int, number: int
) -> Parameters:
    """The parameters of a candidate, by Optuna's tree-structured Parzen estimator.

    Args:
      distributions: what they may be.
      earlier: the candidates before it; only those that are complete say something.
      seed: of the search.
      number: of the candidate; with the seed it decides the random numbers.
    """
    import optuna
    from optuna.trial import TrialState

    words = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
    sampled = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=words))
    sampled.add_trials([candidate for candidate in earlier if candidate.state == TrialState.COMPLETE])
    return sampled.ask(dict(distributions)).params


def _check_space(search: Search) -> None:
    """A choice that makes no experiment is a mistake, and so is an interval neither of whose ends does.

    One end may: whether the other is possible can depend on what else is searched.

    Raises:
      UserError, SpecError: on a mistake, before anything is written.
    """
    for key, distribution in search.distributions.items():
        choices = getattr(distribution, "choices", None)
        errors = []
        for value in choices or (distribution.low, distribution.high):
            try:
                read(search.configure({key: value}))
            except UserError as error:
                errors.append(error)
        if errors and (choices or len(errors) == 2):
            raise errors[0]


def _check_ours(search: Search) -> None:
    """Whether the folder is there for this search, looked at before anything in it is written, its lock included.

    Raises:
      UserError: if it holds something else, with the difference.
    """
    folder, record = search.folder, search.record()
    if not folder.is_dir() or all(entry.name.startswith(".") for entry in folder.iterdir()):
        return
    before = read_record(folder / SEARCH, record)
    if before is None:
        raise UserError(
            f"{folder} exists and holds no search (its {SEARCH} is missing or not one of ours); "
            f"set another name=... or runs_dir=..."
        )
    if not search.machinery.overwrite and (wrong := differences(_unfolded(before), _unfolded(record))):
        raise UserError(
            f"{folder} holds another search:\n{wrong}\nSet another name=..., or overwrite=true to delete what is there."
        )


def _prepare(search: Search) -> None:
    """Makes the folder ready: new, emptied with overwrite=true, or the same search's."""
    _check_ours(search)  # again: another process may have begun
    if search.machinery.overwrite:
        empty(search.folder, search.folder / SEARCH)
    write_text(search.folder / SEARCH, yaml.safe_dump(search.record(), sort_keys=False))


def _unfolded(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with the keys of its config beside its own."""
    rest = dict(record)
    config = rest.pop("config")
    return {**(config if isinstance(config, dict) else {"config": config}), **rest}


def results(search: Search, candidate: FrozenTrial) -> list[Mapping[str, Any]]:
    """What the sealed files of a candidate's runs say, in the order of its tables; none if one is not whole."""
    try:
        study, _ = search.candidate(candidate.number, candidate.params)
    except UserError:
        return []
    found: list[Mapping[str, Any]] = list(finished(search.candidate_folder(candidate.number), study).values())
    return found if len(found) == len(study.runs()) else []


def objective(found: Sequence[Mapping[str, Any]]) -> float:
    """What is maximised: robustness of the final mean policy, averaged over cases and seeds; NaN without any."""
    return sum(float(run["robustness_policy"]) for run in found) / len(found) if found else math.nan


def values_of(found: Results) -> dict[int, float]:
    """The objective of every candidate that has results."""
    return {number: objective(runs) for number, runs in found.items()}


def table_of(candidates: Sequence[FrozenTrial], found: Results) -> list[dict[str, Any]]:
    """trials.csv: the finished candidates, in order."""
    table = []
    for candidate in candidates:
        if not candidate.state.is_finished():
            continue
        row = {"number": candidate.number, **candidate.params, "state": candidate.state.name}
        row |= {key: value for key, value in candidate.user_attrs.items() if key == "message"}
        if runs := found.get(candidate.number):
            row |= {
                "objective": objective(runs),
                "satisfied": sum(bool(run["satisfied"]) for run in runs),
                "runs": len(runs),
                "successes": sum(int(run["successes"]) for run in runs),
                "trials": sum(int(run["trials"]) for run in runs),
            }
        elif candidate.value is not None:
            row["message"] = "its runs are not whole; the search with more --trials computes them again"
        table.append(row)
    return table


def write_tables(search: Search, table: Sequence[Mapping[str, Any]]) -> None:
    """Writes trials.csv and summary.md."""
    columns = ["number", *search.space, "objective", "satisfied", "runs", "successes", "trials", "state"]
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(table)
    write_text(search.folder / TRIALS, text.getvalue())
    write_text(search.folder / SUMMARY_PAGE, summary_page(search, table))


def summary_page(search: Search, table: Sequence[Mapping[str, Any]]) -> str:
    """summary.md: the candidates, best first, and the command that runs the best one on other seeds."""
    ranked = best_first(table)
    failed = failures(table)
    lines = [
        f"# {search.folder.name}",
        "",
        f"{len(table)} candidates, sampler's seed {search.seed}; each is {len(search.base.runs())} runs of "
        f"{search.base.algorithm.iterations} iterations: cases {', '.join(c.name for c in search.base.cases)}, seeds "
        f"{', '.join(map(str, search.base.seeds))}. Robustness is that of the final mean policy, averaged over them.",
        "",
        *(f"- {key}: {text}" for key, text in search.space.items()),
        "",
        f"| candidate | {' | '.join(search.space)} | robustness | satisfied | successful trials |",
        "|---" * (len(search.space) + 4) + "|",
        *(
            f"| {row['number']} | {' | '.join(_short(row[key]) for key in search.space)} | {row['objective']:+.4f} "
            f"| {row['satisfied']} of {row['runs']} | {row['successes']} of {row['trials']} |"
            for row in ranked
        ),
        "",
    ]
    if ranked:
        lines += [
            "The best at the experiment's own budget and seeds:",
            "",
            f"    {best_command(search, ranked[0])}",
            "",
        ]
    if failed:
        lines += ["## Failed candidates", ""]
        for row in failed:
            why = row.get("message") or f"see {search.candidate_folder(row['number']).name}/{LOG}"
            lines.append(f"- {row['number']}, {describe({key: row[key] for key in search.space})}: {why}")
        lines.append("")
    return "\n".join(lines)


def failures(table: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The rows that have no objective."""
    return [row for row in table if "objective" not in row]


def best_first(table: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The rows that have an objective; of equal ones the earlier candidate is first."""
    return sorted((row for row in table if "objective" in row), key=lambda row: -row["objective"])


def best_command(search: Search, row: Mapping[str, Any]) -> str:
    """The command that runs a candidate's config as the experiment it came from: its own seeds, trials, iterations."""
    given = {override: override.partition("=")[0].lstrip("+") for override in search.fixed}
    learners = [type(settings) for settings in search.base.learners.values()]
    taken = [override for override, key in given.items() if key != "name" and not is_budget(key, learners)]
    found = [f"{key}={row[key]}" for key in search.space]
    return shlex.join(["tltl-run", *taken, *found, f"name={search.folder.name}_best"])


def describe(parameters: Parameters) -> str:
    """Parameters as text, for messages."""
    return ", ".join(f"{key}={_short(value)}" for key, value in parameters.items())


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)
