"""Writes the tables of an experiment, learning_curves.csv, summary.csv, summary.md and report.md, and its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tltlrl.logic import Spec
from tltlrl.logic.reasons import from_json, merge
from tltlrl.reports.clauses import Standing, plot_clauses, standings, stuck_lines
from tltlrl.reports.interval import FEWEST, LEVEL, Array, mean_interval, share_interval
from tltlrl.reports.motion import has_path
from tltlrl.reports.plotting import FORMATS, plot_learning_curves, titled
from tltlrl.simulation.motion import MEASURES
from tltlrl.store.files import write_text
from tltlrl.store.layout import (
    CALM_WORKSPACE,
    CLAUSES_FIGURE,
    CURVES,
    FIGURE,
    PAGE,
    PROGRESS,
    REPORT,
    SUMMARY,
    SUMMARY_PAGE,
    WORKSPACE,
    run_of,
)
from tltlrl.store.run import joined
from tltlrl.tasks.task import Task
from tltlrl.training.build import make_task
from tltlrl.training.study import Study

ITERATIONS = ("first_satisfied_iteration", "satisfied_for_good_iteration")


@dataclass(frozen=True)
class Tables:
    """The tables of an experiment's runs.

    Attributes:
      curves, summary: learning_curves.csv and summary.csv.
      standings: case => seed => the values of the spec's parts.
    """

    curves: pd.DataFrame
    summary: pd.DataFrame
    standings: Mapping[str, Mapping[int, Standing]]


def write_report(
    folder: Path, study: Study, finished: Mapping[Path, Mapping[str, Any]], failures: Mapping[str, str]
) -> tuple[list[str], Tables | None]:
    """Writes every table and figure from the finished runs' files, and lists the failures.

    If no run has finished, older tables and figures are deleted, because their runs no longer exist.

    Args:
      folder: folder of the experiment.
      study: what was asked for.
      finished: folder of a run => its results, in the order of the tables.
      failures: run => message.

    Returns:
      The outcome in a few lines, and the tables if a run has finished.
    """
    if not finished:
        pictures = (f"{name}{suffix}" for name in (FIGURE, CLAUSES_FIGURE) for suffix in FORMATS)
        for name in (CURVES, SUMMARY, REPORT, PAGE, *pictures):
            (folder / name).unlink(missing_ok=True)
        lines = [f"# {study.name}", "", "No run has finished.", *_failure_lines(failures)]
        write_text(folder / SUMMARY_PAGE, "\n".join(lines) + "\n")
        return ["no run has finished"], None
    write_text(folder / CURVES, joined([(path / PROGRESS).read_text(encoding="utf-8") for path in finished]))
    curves = pd.read_csv(folder / CURVES)
    summary = summarise(curves, finished)
    write_text(folder / SUMMARY, summary.to_csv(index=False, lineterminator="\n"))
    write_text(folder / SUMMARY_PAGE, summary_page(study, summary, failures))
    known = standings(finished)
    write_text(folder / REPORT, report_page(study, summary, finished, failures, known))
    plot_learning_curves(titled([folder], [curves]), folder / FIGURE)
    if known:
        plot_clauses(known, folder / CLAUSES_FIGURE)
    return outcome_lines(summary), Tables(curves, summary, known)


def median_run(finished: Mapping[Path, Mapping[str, Any]], case: str) -> Path | None:
    """The folder of the case's finished run with the median robustness; of two in the middle, the lower.

    Args:
      finished: folder of a run => its results.
      case: its name.
    """
    own = [path for path in finished if run_of(path)[0] == case]
    return sorted(own, key=lambda path: finished[path]["robustness_policy"])[(len(own) - 1) // 2] if own else None


def summarise(curves: pd.DataFrame, outcomes: Mapping[Path, Mapping[str, Any]]) -> pd.DataFrame:
    """One row per case and seed: how good the learned policy is, and when it first satisfied the spec.

    With `keep: best` that is asked of the best policy so far, which is the one that is kept.

    Args:
      curves: learning_curves.csv.
      outcomes: folder of the run => its done.json, in the order of the rows.
    """
    rows = []
    runs = curves.groupby(["case", "seed"], sort=False)
    for path, done in outcomes.items():
        case, seed = run_of(path)
        run = runs.get_group((case, seed))
        policy = run["robustness_policy"]
        if "robustness_kept" in run:
            policy = run["robustness_kept"].fillna(policy)
        satisfied, violated = run.loc[policy > 0, "iteration"], run.loc[policy <= 0, "iteration"]
        rows.append(
            {
                "task": run["task"].iloc[0],
                "case": case,
                "seed": seed,
                "robustness_policy": done["robustness_policy"],
                "satisfied": done["satisfied"],
                "first_satisfied_iteration": satisfied.iloc[0] if len(satisfied) else None,
                "satisfied_for_good_iteration": max(violated, default=-1) + 1 if done["satisfied"] else None,
                "robustness_mean_last": run["robustness_mean"].iloc[-1],
                "robustness_mean_over_run": run["robustness_mean"].mean(),
                **{name: done.get("motion", {}).get(name) for name in MEASURES},  # results of 0.1 have none
                "trials": done["trials"],
                "successes": done["successes"],
                "success_rate": done["successes"] / done["trials"],
                **done["outcomes"],
            }
        )
        if "calm" in done:
            calm = done["calm"]
            rows[-1] |= {f"calm_{name}": calm[name] for name in CALM_COLUMNS}
            rows[-1] |= {f"calm_{name}": calm["motion"][name] for name in MEASURES}
            rows[-1] |= {f"calm_{name}": value for name, value in calm["outcomes"].items()}
    return pd.DataFrame(rows).astype(dict.fromkeys(ITERATIONS, "Int64") | dict.fromkeys(MEASURES, "float64"))


def median_iteration(iterations: pd.Series) -> str:
    """The median over all seeds; a seed that never satisfied the spec counts as the latest."""
    median = iterations.astype(float).fillna(np.inf).median()
    return f"{median:.1f}".removesuffix(".0") if np.isfinite(median) else "never"


def outcome_lines(summary: pd.DataFrame) -> list[str]:
    """The outcome, one line per case; with several seeds the median robustness, the lowest and the highest."""
    lines = []
    for case, rows in summary.groupby("case", sort=False):
        policy = rows["robustness_policy"]
        spread = f", {policy.min():.3f} to {policy.max():.3f}" if len(rows) > 1 else ""
        lines.append(
            f"{case}: satisfied {rows['satisfied'].sum()} of {len(rows)}; robustness {policy.median():.3f}{spread}; "
            f"trials {rows['successes'].sum()} of {rows['trials'].sum()}"
        )
    return lines


def summary_page(study: Study, summary: pd.DataFrame, failures: Mapping[str, str]) -> str:
    """summary.md: one line per case."""
    judged = judged_besides(summary)
    enough = summary["seed"].nunique() >= FEWEST
    interval = f" ({100 * LEVEL:.0f} % t interval)" if enough else ""
    lines = [
        f"# {study.name}",
        "",
        f"Spec `{study.spec.formula}`, {len(study.seeds)} seeds, "
        f"{study.algorithm.iterations} iterations of {study.algorithm.samples} samples. "
        "Robustness is that of the spec for every case, whatever it was trained on; above 0 the spec is satisfied.",
        "",
        "| case | satisfied | robustness of the mean policy, median (min to max) | first satisfied iteration, median "
        "| satisfied for good from iteration, median "
        f"| robustness of samples, last iteration, mean{interval} | successful trials |"
        + "".join(f" trials with {name.replace('_', ' ')} |" for name in judged),
        "|---|---|---|---|---|---|---|" + "---|" * len(judged),
    ]
    for case, rows in summary.groupby("case", sort=False):
        policy = rows["robustness_policy"]
        lines.append(
            f"| {case} | {rows['satisfied'].sum()} of {len(rows)} "
            f"| {policy.median():.3f} ({policy.min():.3f} to {policy.max():.3f}) "
            f"| {' | '.join(median_iteration(rows[name]) for name in ITERATIONS)} "
            f"| {_mean(rows['robustness_mean_last'].to_numpy())} "
            f"| {rows['successes'].sum()} of {rows['trials'].sum()} |"
            + "".join(f" {rows[name].sum()} of {rows['trials'].sum()} |" for name in judged)
        )
    return "\n".join([*lines, *_failure_lines(failures)]) + "\n"


def report_page(
    study: Study,
    summary: pd.DataFrame,
    finished: Mapping[Path, Mapping[str, Any]],
    failures: Mapping[str, str],
    known: Mapping[str, Mapping[int, Standing]],
) -> str:
    """report.md: the summary, the figures, what failed and why, and the settings."""
    task = make_task(study.task)
    lines = [
        summary_page(study, summary, failures),
        f"![Learning curves]({FIGURE}.png)",
        *(["", f"![What decides, clause by clause]({CLAUSES_FIGURE}.png)"] if known else []),
        *bottleneck_lines(finished, task.control_timestep),
        *stuck_lines(finished, known, study.spec.asks_for, study.algorithm.samples),
        *picture_lines(task, study.spec, finished),
        *motion_lines(summary),
        *trial_lines(summary, finished, task.control_timestep),
        "",
        "## Settings",
        "",
        *(f"- {key}: {value}" for key, value in study.settings.items()),
    ]
    return "\n".join(lines) + "\n"


def picture_lines(task: Task, spec: Spec, finished: Mapping[Path, Mapping[str, Any]]) -> list[str]:
    """The workspace pictures of the cases, where there is a path to draw."""
    cases = dict.fromkeys(run_of(path)[0] for path in finished)
    calm = {run_of(path)[0] for path, done in finished.items() if "calm" in done}
    if not has_path(task, spec):
        return []
    return [
        "",
        "## The learned motions",
        "",
        "Of each case the seed with the median robustness of the mean policy.",
        "",
        *(f"![{case}]({case}/{WORKSPACE}.png)" for case in cases),
        *(f"![{case}, calm]({case}/{CALM_WORKSPACE}.png)" for case in cases if case in calm),
    ]


def measured(summary: pd.DataFrame) -> dict[str, str]:
    """The measures of motion that some policy has: column => how a page names it."""
    known = (name for name in MEASURES if summary[name].notna().any())
    return {name: name.replace("_", " ").replace("rms", "RMS") for name in known}


def medians_of_motion(summary: pd.DataFrame) -> list[tuple[str, bool, list[str]]]:
    """For every case, and for its calm policies, the median of each of those measures over the seeds.

    Returns:
      The case, whether the row is of calm policies, and the medians; an empty text where there is none.
    """
    known, found = measured(summary), []
    for case, rows in summary.groupby("case", sort=False):
        for is_calm in (False, True):
            if is_calm and ("calm_successes" not in rows or rows["calm_successes"].isna().all()):
                continue
            columns = (rows[f"{'calm_' if is_calm else ''}{name}"].astype(float) for name in known)
            values = (column.dropna().median() for column in columns)  # pandas 2.2 warns of a median of nothing but NaN
            found.append((str(case), is_calm, [f"{value:.3g}" if np.isfinite(value) else "" for value in values]))
    return found


def motion_lines(summary: pd.DataFrame) -> list[str]:
    """The lines about motion: for every case, the median of each measure over the seeds."""
    names = measured(summary)
    if not names:
        return []
    lines = [
        "",
        "## How the learned policies move",
        "",
        OF_THE_MOTION,
        "",
        f"| case | {' | '.join(names.values())} |",
        "|---" * (1 + len(names)) + "|",
    ]
    for case, is_calm, medians in medians_of_motion(summary):
        lines.append(f"| {case}{', calm' * is_calm} | {' | '.join(medians)} |")
    units = (f"- {name}: {MEASURES[column]}" for column, name in names.items())
    return [*lines, "", *units, *_calm_lines(summary)]


def _calm_lines(summary: pd.DataFrame) -> list[str]:
    """The lines about calm policies, if there are any; all other lines are about the learned policies."""
    if "calm_successes" not in summary:
        return []
    judged = judged_besides(summary)
    lines = [
        "",
        "Calm policies follow the learned motion simplified (`algorithm.calm`); the learned ones stay as they are, and "
        "everything else on this page is of those.",
        "",
        "| case, calm | satisfied | robustness, median (min to max) | share of the learned one, least "
        "| successful trials |"
        + "".join(f" trials with {name.replace('_', ' ')} |" for name in judged)
        + " episodes it took, median |",
        "|---" * (6 + len(judged)) + "|",
    ]
    for case, rows in summary[summary["calm_successes"].notna()].groupby("case", sort=False):
        worth = rows["calm_robustness_policy"].astype(float)
        lines.append(
            f"| {case} | {int(rows['calm_satisfied'].sum())} of {len(rows)} "
            f"| {worth.median():.3f} ({worth.min():.3f} to {worth.max():.3f}) "
            f"| {(worth / rows['robustness_policy']).min():.2f} "
            f"| {int(rows['calm_successes'].sum())} of {rows['trials'].sum()} |"
            + "".join(f" {int(rows[f'calm_{name}'].sum())} of {rows['trials'].sum()} |" for name in judged)
            + f" {rows['calm_episodes'].median():.0f} |"
        )
    return lines


def trial_lines(summary: pd.DataFrame, finished: Mapping[Path, Mapping[str, Any]], timestep: float) -> list[str]:
    """The lines about every run's trials: success with a 95 % Wilson interval, and why trials failed."""
    judged = judged_besides(summary)
    lines = [
        "",
        "## Trials of the learned policies",
        "",
        "| case | seed | successful trials (95 % Wilson interval) |"
        + "".join(f" with {name.replace('_', ' ')} |" for name in judged)
        + " why trials failed |",
        "|---" * (4 + len(judged)) + "|",
    ]
    for (_, row), done in zip(summary.iterrows(), finished.values(), strict=True):
        lines.append(
            f"| {row['case']} | {row['seed']} | {_rate(row['successes'], row['trials'])} |"
            + "".join(f" {row[name]} of {row['trials']} |" for name in judged)
            + f" {_why(done, timestep)} |"
        )
    return [*lines, "", f"Why: {HOW_DECIDED}"]


def bottleneck_lines(finished: Mapping[Path, Mapping[str, Any]], timestep: float) -> list[str]:
    """The lines about cases with mean policies that violate the spec: what decides, over the seeds."""
    by_case: dict[str, list[Mapping[str, Any]]] = {}
    for path, done in finished.items():
        by_case.setdefault(run_of(path)[0], []).append(done)
    lines = []
    for case, runs in by_case.items():
        violated = [done for done in runs if not done["satisfied"]]
        if violated:
            lines.append(f"- {case}, {len(violated)} of {len(runs)} seeds:")
            reasons = merge(reason for done in violated for reason in from_json(done["why_policy_fails"]))
            lines += [f"  - {reason.count} of {len(runs)}: {reason.told(timestep)}" for reason in reasons]
    if not lines:
        return []
    return ["", "## What holds the failed policies back", "", *lines, "", f"Listed: {HOW_DECIDED}"]


CALM_COLUMNS = ("robustness_policy", "satisfied", "successes", "episodes", "env_steps")

OF_THE_MOTION = "Of the noise-free motion of the mean policy, the median over the seeds."
HOW_DECIDED = (
    "the predicate whose margin at that step is the robustness, since min and max select; `!(...)` where the "
    "predicate should not hold; then the named sub-formula that it stands in."
)


def judged_besides(summary: pd.DataFrame) -> list[str]:
    """The names of what the task itself judges in trials, besides the spec."""
    after = list(summary.columns).index("success_rate") + 1
    return [name for name in summary.columns[after:] if not name.startswith("calm_")]


def _mean(values: Array) -> str:
    """A mean, with its interval if there are enough values."""
    low, high = mean_interval(values)
    return f"{values.mean():.3f}" + (f" ({low:.3f} to {high:.3f})" if np.isfinite(low) else "")


def _rate(successes: Any, count: Any) -> str:
    low, high = share_interval(successes, count)
    return f"{successes} of {count} ({low:.3f} to {high:.3f})"


def _why(done: Mapping[str, Any], timestep: float) -> str:
    """Why trials of a run failed, in one cell of a table."""
    return "; ".join(f"{r.count}: {r.told(timestep)}" for r in from_json(done["why_trials_fail"])).replace("|", "\\|")


def _failure_lines(failures: Mapping[str, str]) -> list[str]:
    if not failures:
        return []
    return ["", "## Failed runs", "", *(f"- {run}: {message}" for run, message in failures.items())]
