"""The tables of an experiment: learning_curves.csv, summary.csv, summary.md and report.md, and its figure."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from tltlrl.logic.reasons import from_json, merge
from tltlrl.reports.plotting import FORMATS, plot_learning_curves
from tltlrl.simulation.motion import MEASURES
from tltlrl.store.files import write_text
from tltlrl.store.layout import CURVES, FIGURE, PROGRESS, REPORT, SUMMARY, SUMMARY_PAGE, WORKSPACE, run_of
from tltlrl.tasks.task import Task
from tltlrl.training.build import make_task
from tltlrl.training.calm import SHARE
from tltlrl.training.study import Study

CALM = "calm_"  # before the names of the columns of calm motions


def write_report(
    folder: Path, study: Study, finished: Mapping[Path, Mapping[str, Any]], failures: Mapping[str, str]
) -> None:
    """Writes every table and figure from the finished runs' files; what failed is listed.

    If no run has finished, tables and figures of an earlier time, whose runs are there no more, are deleted.

    Args:
      folder: where to.
      study: what was asked for.
      finished: folder of a run => its results, in the order of the tables.
      failures: run => message.
    """
    if not finished:
        for name in (CURVES, SUMMARY, REPORT, *(f"{FIGURE}{suffix}" for suffix in FORMATS)):
            (folder / name).unlink(missing_ok=True)
        lines = [f"# {study.name}", "", "No run has finished.", *_failure_lines(failures)]
        write_text(folder / SUMMARY_PAGE, "\n".join(lines) + "\n")
        return
    write_text(folder / CURVES, joined([(path / PROGRESS).read_text() for path in finished]))
    curves = pd.read_csv(folder / CURVES)
    summary = summarise(curves, finished)
    write_text(folder / SUMMARY, summary.to_csv(index=False, lineterminator="\n"))
    write_text(folder / SUMMARY_PAGE, summary_page(study, summary, failures))
    write_text(folder / REPORT, report_page(study, summary, finished, failures))
    plot_learning_curves([curves], folder / FIGURE)


def joined(tables: Sequence[str]) -> str:
    """CSV texts as one: a column that some do not have, as another learner's diagnostics, is empty in their rows."""
    rows = [row for table in tables for row in csv.DictReader(io.StringIO(table))]
    columns = dict.fromkeys(name for table in tables for name in table.split("\n", 1)[0].split(","))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def summarise(curves: pd.DataFrame, outcomes: Mapping[Path, Mapping[str, Any]]) -> pd.DataFrame:
    """One row per case and seed: the learned policy's worth, and when it first was worth something.

    Args:
      curves: learning_curves.csv.
      outcomes: folder of the run => its done.json, in the order of the rows.
    """
    rows = []
    asked = any("calm" in done for done in outcomes.values())
    runs = curves.groupby(["case", "seed"], sort=False)
    for path, done in outcomes.items():
        case, seed = run_of(path)
        run = runs.get_group((case, seed))
        satisfied = run.loc[run["robustness_policy"] > 0, "iteration"]
        rows.append(
            {
                "task": run["task"].iloc[0],
                "case": case,
                "seed": seed,
                "robustness_policy": done["robustness_policy"],
                "satisfied": done["satisfied"],
                "first_satisfied_iteration": satisfied.iloc[0] if len(satisfied) else None,
                "robustness_mean_last": run["robustness_mean"].iloc[-1],
                "robustness_mean_over_run": run["robustness_mean"].mean(),
                **{name: done.get("motion", {}).get(name) for name in MEASURES},  # results of 0.1 have none
                **(_of_calm(done.get("calm") or {}) if asked else {}),
                "trials": done["trials"],
                "successes": done["successes"],
                "success_rate": done["successes"] / done["trials"],
                **done["outcomes"],
            }
        )
    kinds = {name: "float64" for name in rows[0] if name.removeprefix(CALM) in MEASURES}
    kinds |= {name: "Int64" for name in rows[0] if name in (f"{CALM}episodes", f"{CALM}successes")}
    return pd.DataFrame(rows).astype({"first_satisfied_iteration": "Int64"} | kinds)


def _of_calm(done: Mapping[str, Any]) -> dict[str, Any]:
    """The columns of a calm motion; empty ones where there is none, as the learned one violates the spec."""
    values = {name: done.get(name) for name in ("episodes", "robustness_policy", "successes")}
    values |= done.get("outcomes", {}) | {name: done.get("motion", {}).get(name) for name in MEASURES}
    return {f"{CALM}{name}": value for name, value in values.items()}


def summary_page(study: Study, summary: pd.DataFrame, failures: Mapping[str, str]) -> str:
    """summary.md: one line per case."""
    judged = _judged(summary)
    lines = [
        f"# {study.name}",
        "",
        f"Spec `{study.spec.formula}`, {len(study.seeds)} seeds, "
        f"{study.algorithm.iterations} iterations of {study.algorithm.samples} samples. "
        "Robustness is that of the spec for every case, whatever it was trained on; above 0 the spec is satisfied.",
        "",
        "| case | satisfied | robustness of the mean policy, median (min to max) | first satisfied iteration, median "
        "| robustness of samples, last iteration | successful trials |"
        + "".join(f" trials with {name.replace('_', ' ')} |" for name in judged),
        "|---|---|---|---|---|---|" + "---|" * len(judged),
    ]
    for case, rows in summary.groupby("case", sort=False):
        policy = rows["robustness_policy"]
        first = rows["first_satisfied_iteration"].astype(float).fillna(np.inf).median()  # over all seeds
        lines.append(
            f"| {case} | {rows['satisfied'].sum()} of {len(rows)} "
            f"| {policy.median():.3f} ({policy.min():.3f} to {policy.max():.3f}) "
            f"| {f'{first:.0f}' if np.isfinite(first) else 'never'} "
            f"| {rows['robustness_mean_last'].mean():.3f} "
            f"| {rows['successes'].sum()} of {rows['trials'].sum()} |"
            + "".join(f" {rows[name].sum()} of {rows['trials'].sum()} |" for name in judged)
        )
    return "\n".join([*lines, *_failure_lines(failures)]) + "\n"


def report_page(
    study: Study,
    summary: pd.DataFrame,
    finished: Mapping[Path, Mapping[str, Any]],
    failures: Mapping[str, str],
) -> str:
    """report.md: the summary, the figures, what failed and why, and the settings."""
    task = make_task(study.task)
    lines = [
        summary_page(study, summary, failures),
        f"![Learning curves]({FIGURE}.png)",
        *bottleneck_lines(finished, task.control_timestep),
        *picture_lines(task, finished),
        *motion_lines(summary),
        *trial_lines(summary, finished, task.control_timestep),
        "",
        "## Settings",
        "",
        *(f"- {key}: {value}" for key, value in study.settings.items()),
    ]
    return "\n".join(lines) + "\n"


def picture_lines(task: Task, finished: Mapping[Path, Mapping[str, Any]]) -> list[str]:
    """The workspace pictures of the cases, for tasks that have them."""
    cases = dict.fromkeys(run_of(path)[0] for path in finished)
    if task.skeleton is None:
        return []
    return [
        "",
        "## The learned motions",
        "",
        "Of each case the seed with the median robustness of the mean policy.",
        "",
        *(f"![{case}]({case}/{WORKSPACE}.png)" for case in cases),
    ]


def motion_lines(summary: pd.DataFrame) -> list[str]:
    """How the learned policies move, and the calm ones: of every case the median of each measure over the seeds."""
    known = [name for name in MEASURES if summary[name].notna().any()]
    if not known:
        return []
    heads = {name: name.replace("_", " ").replace("rms", "RMS") for name in known}
    shown = ["robustness_policy", *known]
    lines = [
        "",
        "## How the learned policies move",
        "",
        "Of the noise-free motion of the mean policy, the median over the seeds.",
        "",
        "| case | robustness | successful trials |" + "".join(f" {heads[name]} |" for name in known),
        "|---" * (3 + len(known)) + "|",
    ]
    for case, rows in summary.groupby("case", sort=False):
        lines.append(f"| {case} | {_medians(rows, rows['successes'], shown)}")
        if f"{CALM}episodes" in rows and (calm := rows[rows[f"{CALM}episodes"].notna()]).size:
            medians = _medians(calm, calm[f"{CALM}successes"], [f"{CALM}{name}" for name in shown])
            lines.append(f"| {case}, calm | {medians}")
    if f"{CALM}episodes" in summary:
        episodes = summary[f"{CALM}episodes"]
        lines += [
            "",
            f"Calm: the learned motion, simplified afterwards by shortcuts that keep its robustness above {SHARE:.0%} "
            f"of what was learned; {episodes.count()} of {len(summary)} could be, with "
            f"{episodes.median():.0f} more episodes each (median)."
        ]  # fmt: skip
    return [*lines, "", *(f"- {heads[name]}: {MEASURES[name]}" for name in known)]


def _medians(rows: pd.DataFrame, successes: pd.Series, names: Sequence[str]) -> str:
    """Cells: the median robustness, successful trials, the medians of what else is named."""
    first, *others = (f"{value:.3g}" if np.isfinite(value) else "" for value in (rows[name].median() for name in names))
    return " | ".join([first, f"{successes.sum()} of {rows['trials'].sum()}", *others]) + " |"


def trial_lines(summary: pd.DataFrame, finished: Mapping[Path, Mapping[str, Any]], timestep: float) -> list[str]:
    """The trials of every run, with a 95 % Wilson interval, and why trials failed."""
    judged = _judged(summary)
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
    """For every case with mean policies that violate the spec: what decides so, over its seeds."""
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


HOW_DECIDED = (
    "the predicate whose margin at that step is the robustness, since min and max select; `!(...)` where the "
    "predicate should not hold; then the named sub-formula that it stands in."
)


def _judged(summary: pd.DataFrame) -> list[str]:
    """What the task judges of a trial besides the spec."""
    return list(summary.columns[list(summary.columns).index("success_rate") + 1 :])


def _rate(successes: Any, count: Any) -> str:
    interval = binomtest(int(successes), int(count)).proportion_ci(method="wilson")
    return f"{successes} of {count} ({interval.low:.3f} to {interval.high:.3f})"


def _why(done: Mapping[str, Any], timestep: float) -> str:
    """Why trials of a run failed, in one cell of a table."""
    return "; ".join(f"{r.count}: {r.told(timestep)}" for r in from_json(done["why_trials_fail"])).replace("|", "\\|")


def _failure_lines(failures: Mapping[str, str]) -> list[str]:
    if not failures:
        return []
    return ["", "## Failed runs", "", *(f"- {run}: {message}" for run, message in failures.items())]
