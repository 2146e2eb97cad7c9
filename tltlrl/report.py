"""The tables of an experiment: learning_curves.csv, summary.csv, summary.md and report.md, and its figure."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
from scipy.stats import binomtest

from tltlrl.comparison import Comparison, compare
from tltlrl.config import Experiment
from tltlrl.files import write_text
from tltlrl.plotting import CURVES, plot_learning_curves
from tltlrl.record import PROGRESS

TLTL = "tltl_episodic"
SIGNIFICANT = 0.05
SUMMARY, SUMMARY_PAGE, REPORT = "summary.csv", "summary.md", "report.md"


def write_report(
    folder: Path, experiment: Experiment, finished: Mapping[Path, Mapping[str, Any]], failures: Mapping[str, str]
) -> None:
    """Writes every table and figure from the finished runs' files; what failed is listed.

    Args:
      folder: where to.
      experiment: what was asked for.
      finished: folder of a run => its results, in the order of the tables.
      failures: run => message.
    """
    if not finished:
        return
    tables = [(path / PROGRESS).read_text().split("\n", 1) for path in finished]
    write_text(folder / CURVES, tables[0][0] + "\n" + "".join(rows for _, rows in tables))
    curves = pd.read_csv(folder / CURVES)
    summary = summarise(curves, finished)
    write_text(folder / SUMMARY, summary.to_csv(index=False, lineterminator="\n"))
    write_text(folder / SUMMARY_PAGE, summary_page(experiment, summary, failures))
    write_text(folder / REPORT, report_page(experiment, summary, failures))
    plot_learning_curves([curves], folder / "learning_curves")


def summarise(curves: pd.DataFrame, outcomes: Mapping[Path, Mapping[str, Any]]) -> pd.DataFrame:
    """One row per case and seed: the learned policy's worth, and when it first was worth something.

    Args:
      curves: learning_curves.csv.
      outcomes: folder of the run => its done.json, in the order of the rows.
    """
    rows = []
    runs = curves.groupby(["case", "seed"], sort=False)
    for path, done in outcomes.items():
        case, seed = path.parent.name, int(path.name.removeprefix("seed_"))
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
                "trials": done["trials"],
                "successes": done["successes"],
                "success_rate": done["successes"] / done["trials"],
                **done["outcomes"],
            }
        )
    return pd.DataFrame(rows).astype({"first_satisfied_iteration": "Int64"})


def summary_page(experiment: Experiment, summary: pd.DataFrame, failures: Mapping[str, str]) -> str:
    """summary.md: one line per case."""
    judged = list(summary.columns[list(summary.columns).index("success_rate") + 1 :])
    lines = [
        f"# {experiment.name}",
        "",
        f"Spec `{experiment.spec.formula}`, {len(experiment.seeds)} seeds, "
        f"{experiment.algorithm.iterations} iterations of {experiment.algorithm.samples} samples. "
        "Robustness is that of the spec for every case, whatever it was trained on; above 0 the spec is satisfied.",
        "",
        "| case | satisfied | robustness of the mean policy, median (min to max) | first satisfied iteration, median "
        "| robustness of samples, last iteration | successful trials (95 % Wilson interval) |"
        + "".join(f" trials with {name.replace('_', ' ')} |" for name in judged),
        "|---|---|---|---|---|---|" + "---|" * len(judged),
    ]
    for case, rows in summary.groupby("case", sort=False):
        policy, first = rows["robustness_policy"], rows["first_satisfied_iteration"].dropna()
        interval = binomtest(int(rows["successes"].sum()), int(rows["trials"].sum())).proportion_ci(method="wilson")
        lines.append(
            f"| {case} | {rows['satisfied'].sum()} of {len(rows)} "
            f"| {policy.median():.3f} ({policy.min():.3f} to {policy.max():.3f}) "
            f"| {f'{first.median():.0f}' if len(first) else 'never'} "
            f"| {rows['robustness_mean_last'].mean():.3f} "
            f"| {rows['successes'].sum()} of {rows['trials'].sum()} ({interval.low:.3f} to {interval.high:.3f}) |"
            + "".join(f" {rows[name].sum()} of {rows['trials'].sum()} |" for name in judged)
        )
    return "\n".join([*lines, *_failure_lines(failures)]) + "\n"


def report_page(experiment: Experiment, summary: pd.DataFrame, failures: Mapping[str, str]) -> str:
    """report.md: the summary, the figure, what the case study claims of it, and the settings."""
    page = summary_page(experiment, summary, failures)
    settings = "\n".join(f"- {key}: {value}" for key, value in experiment.settings.items())
    claims = "\n".join(claim_lines(summary))
    return f"{page}\n![Learning curves](learning_curves.png)\n{claims}\n## Settings\n\n{settings}\n"


def claim_lines(summary: pd.DataFrame) -> list[str]:
    """What the case study's discussion says of the cases, each with the measured answer."""
    cases = list(summary["case"].unique())
    others = [case for case in cases if case != TLTL]
    lines = [""]
    if TLTL in cases and others:
        rate = compare(summary, TLTL, others, "robustness_mean_over_run")
        final = compare(summary, TLTL, others, "robustness_policy")
        lines += [
            "## What the case study claims",
            "",
            f"**The TLTL reward has the best rate of convergence: {_verdict(rate)}**, by the robustness of the "
            "samples averaged over the run.",
            f"**It has the best final value: {_verdict(final)}**, by the robustness of the learned mean policy.",
            "",
            *_comparison_table([*rate, *final]),
            "",
        ]
    for reward in ("continuous", "discrete"):
        if f"{reward}_episodic" in cases and f"{reward}_step" in cases:
            gain = compare(summary, f"{reward}_step", [f"{reward}_episodic"], "robustness_mean_over_run")
            gain += compare(summary, f"{reward}_step", [f"{reward}_episodic"], "robustness_policy")
            lines += [
                f"**Step-based REPS is a gain for the {reward} reward: {_verdict(gain)}**.",
                "",
                *_comparison_table(gain),
                "",
            ]
    if lines[1:]:
        lines += [
            "Difference: mean over the common seeds, m. P(A > B): share of all pairs of seeds. p: exact paired "
            "permutation test, two-sided, with Holm's correction over the cases compared; with n seeds it cannot be "
            "below 2^(1-n).",
            "",
        ]
    return lines


def _verdict(rows: list[Comparison]) -> str:
    """What the measured differences say of "A is better than every B"."""
    seeds = min(row.seeds for row in rows)
    if not all(row.difference > 0 for row in rows):
        return "not confirmed"
    if all(row.p < SIGNIFICANT for row in rows):
        return f"confirmed (n = {seeds}, p < {SIGNIFICANT:g})"
    return (
        f"so it was on these {seeds} seeds, too few or too much alike to tell (largest p {max(r.p for r in rows):.2f})"
    )


def _comparison_table(rows: list[Comparison]) -> list[str]:
    return [
        "| A | B | measure | n | A - B | P(A > B) | p |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {c.better} | {c.other} | {c.measure} | {c.seeds} | {c.difference:+.3f} | {c.wins:.2f} | {c.p:.3f} |"
            for c in rows
        ),
    ]


def _failure_lines(failures: Mapping[str, str]) -> list[str]:
    if not failures:
        return []
    return ["", "## Failed runs", "", *(f"- {run}: {message}" for run, message in failures.items())]
