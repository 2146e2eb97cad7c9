"""What the case study says of its results (section 3.3.4), each claim with a criterion and the measured answer.

    python -m studies.claims runs/reach_avoid runs/visit_in_order runs/toast

reads summary.csv in the folder of each experiment, writes claims.md beside it and prints it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from tltlrl.errors import UserError
from tltlrl.reports.comparison import EXACT_PAIRS, Comparison, compare
from tltlrl.reports.sealed import read_summary
from tltlrl.store.files import write_text

PAGE = "claims.md"
TLTL = "tltl_episodic"
RATE, FINAL = "robustness_mean_over_run", "robustness_policy"
SIGNIFICANT = 0.05
COMPARABLE = 0.9  # share of the TLTL case's final robustness
MINOR = 0.5  # share of what the episode-based case lacks to the TLTL case


@dataclass(frozen=True)
class Answer:
    """What was measured.

    Attributes:
      verdict: confirmed, not confirmed, or that it cannot be told.
      numbers: what the verdict rests on, in a sentence; "" if the comparisons say it all.
      comparisons: with effect size and p.
    """

    verdict: str
    numbers: str
    comparisons: list[Comparison]


@dataclass(frozen=True)
class Claim:
    """One sentence of the case study.

    Attributes:
      tasks: those it speaks of.
      quote: its words.
      criterion: how it is judged here.
      judge: summary.csv => the answer, or None if the cases it speaks of are not all there.
    """

    tasks: tuple[str, ...]
    quote: str
    criterion: str
    judge: Callable[[pd.DataFrame], Answer | None]


def best(summary: pd.DataFrame) -> Answer | None:
    """Is the TLTL case ahead of every other, in rate and in final value?"""
    others = [case for case in summary["case"].unique() if case != TLTL]
    if not _has(summary, TLTL) or not others:
        return None
    pairs = [(TLTL, other) for other in others]
    rows = [*compare(summary, pairs, RATE), *compare(summary, pairs, FINAL)]
    return Answer(_superior(rows), "", rows)


def margin(summary: pd.DataFrame) -> Answer | None:
    """Does the worst seed of the TLTL case end above the best seed of every other?"""
    others = [case for case in summary["case"].unique() if case != TLTL]
    if not _has(summary, TLTL) or not others:
        return None
    rows = compare(summary, [(TLTL, other) for other in others], FINAL)
    smallest = min(row.difference for row in rows)
    verdict = f"confirmed {_on(summary)}" if all(row.wins == 1 for row in rows) else "not confirmed"
    return Answer(verdict, f"Smallest difference of the means: {smallest:+.3f} m.", [])


def step_minor(summary: pd.DataFrame) -> Answer | None:
    """Is each step-based case a little ahead of the episode-based one with its reward, and do its seeds differ less?"""
    rewards = [r for r in ("discrete", "continuous") if _has(summary, f"{r}_episodic", f"{r}_step")]
    if not rewards or not _has(summary, TLTL):
        return None
    rows = compare(summary, [(f"{reward}_step", f"{reward}_episodic") for reward in rewards], RATE)
    verdicts, spreads = [], []
    for reward, row in zip(rewards, rows, strict=True):
        lacking = _mean(summary, TLTL, RATE) - _mean(summary, row.other, RATE)
        if row.difference <= 0:
            verdicts.append(f"no gain for the {reward} reward")
        elif row.p >= SIGNIFICANT:
            verdicts.append(f"for the {reward} reward a gain that cannot be told from none (p {row.p:.2f})")
        elif row.difference < MINOR * lacking:
            verdicts.append(f"confirmed for the {reward} reward")
        else:
            verdicts.append(f"more than minor for the {reward} reward")
        before, after = (summary.loc[summary["case"] == case, RATE].std() for case in (row.other, row.better))
        spreads.append(f"{reward} {before:.3f} to {after:.3f}, {'less' if after < before else 'not less'}")
    numbers = f"Standard deviation over the seeds, episode-based to step-based: {'; '.join(spreads)}."
    return Answer("; ".join(verdicts), numbers if rows[0].seeds > 1 else "", rows)


def continuous_comparable(summary: pd.DataFrame) -> Answer | None:
    """Does one of the continuous cases come close to the TLTL case?"""
    others = [case for case in ("continuous_episodic", "continuous_step") if _has(summary, case)]
    if not _has(summary, TLTL) or not others:
        return None
    close = [
        case
        for case in others
        if _satisfied(summary, case) >= _satisfied(summary, TLTL)
        and _mean(summary, case, FINAL) >= COMPARABLE * _mean(summary, TLTL, FINAL)
    ]
    verdict = f"confirmed for {' and '.join(close)} {_on(summary)}" if close else "not confirmed"
    rows = compare(summary, [(TLTL, other) for other in others], FINAL)
    return Answer(verdict, _counts(summary, [TLTL, *others]), rows)


def discrete_fails(summary: pd.DataFrame) -> Answer | None:
    """Does the discrete reward never lead to a policy that satisfies the spec?"""
    cases = [case for case in ("discrete_episodic", "discrete_step") if _has(summary, case)]
    if not cases:
        return None
    succeeded = [case for case in cases if _satisfied(summary, case)]
    verdict = (
        f"not confirmed, {' and '.join(succeeded)} did on some seeds" if succeeded else f"confirmed {_on(summary)}"
    )
    return Answer(verdict, _counts(summary, cases), [])


def all_trials_succeed(summary: pd.DataFrame) -> Answer | None:
    """Do all trials of the TLTL case succeed, and none of the comparison reward's?"""
    if not _has(summary, TLTL, "continuous_episodic"):
        return None
    trials = summary.groupby("case")[["successes", "trials"]].sum()
    tltl, other = trials.loc[TLTL], trials.loc["continuous_episodic"]
    confirmed = tltl["successes"] == tltl["trials"] and other["successes"] == 0
    numbers = (
        f"{tltl['successes']} of {tltl['trials']} trials with TLTL, "
        f"{other['successes']} of {other['trials']} with the comparison reward."
    )
    return Answer(f"confirmed {_on(summary)}" if confirmed else "not confirmed", numbers, [])


AHEAD = (
    "the difference is above 0 against every other case, in the robustness of the samples averaged over the run (rate) "
    "and in that of the learned mean policy (final), with p < 0.05 each"
)
CLAIMS = (
    Claim(
        ("reach_avoid", "visit_in_order"),
        "in both tasks TLTL robustness reward resulted in the best learning outcome in terms of convergence rate and "
        "final return",
        AHEAD,
        best,
    ),
    Claim(
        ("reach_avoid", "visit_in_order"),
        "step based REPS showed only minor improvement in the rate of convergence and variance reduction",
        "rate: the robustness of the samples averaged over the run gains something (p < 0.05), but less than half of "
        "what the episode-based case lacks to the TLTL case; variance: the seeds differ less in it",
        step_minor,
    ),
    Claim(
        ("reach_avoid",),
        "For the simpler case of task 1, a well tuned continuous reward achieves comparable learning performance with "
        "the TLTL robustness reward",
        "a continuous case satisfies the spec on as many seeds, and reaches at least 90 % of the TLTL case's mean "
        "final robustness",
        continuous_comparable,
    ),
    Claim(
        ("visit_in_order",),
        "For task 2, the TLTL reward outperforms competing reward functions by a considerable margin",
        "the worst seed of the TLTL case ends above the best seed of every other case",
        margin,
    ),
    Claim(
        ("visit_in_order",),
        "Discrete reward fails to learn a useful policy due to sparse returns",
        "no seed's mean policy satisfies the spec",
        discrete_fails,
    ),
    Claim(
        ("toast",),
        "training with TLTL reward has reached a significantly better policy than that with the comparison reward",
        AHEAD,
        best,
    ),
    Claim(
        ("toast",),
        "The policy from the TLTL reward achieves 100% success rate while the comparison reward fails to learn the "
        "task",
        "every noisy trial of every seed satisfies the spec with TLTL, and none with the comparison reward",
        all_trials_succeed,
    ),
)


def claim_lines(summary: pd.DataFrame) -> list[str]:
    """The claims about this summary's task, as lines of claims.md; none if the cases they speak of are not there."""
    task = summary["task"].iloc[0]
    lines = []
    for claim in CLAIMS:
        answer = claim.judge(summary) if task in claim.tasks else None
        if answer is not None:
            lines += [
                f'"{claim.quote}": **{answer.verdict}**.',
                f"Criterion: {claim.criterion}. {answer.numbers}".rstrip(),
                "",
                *_table(answer.comparisons),
            ]
    if not lines:
        return []
    return [
        "",
        "## What the case study claims",
        "",
        *lines,
        "A - B: mean over the common seeds, m. P(A > B): share of all pairs of seeds. p: paired permutation test, "
        f"two-sided, exact up to {EXACT_PAIRS} seeds, with Holm's correction over the rows of one measure; before the "
        "correction n seeds cannot give less than 2^(1-n).",
        "",
    ]


def _on(summary: pd.DataFrame) -> str:
    """On how many seeds a verdict without a test rests."""
    return f"(n = {summary['seed'].nunique()})"


def _has(summary: pd.DataFrame, *cases: str) -> bool:
    return set(cases) <= set(summary["case"])


def _mean(summary: pd.DataFrame, case: str, measure: str) -> float:
    return float(summary.loc[summary["case"] == case, measure].mean())


def _satisfied(summary: pd.DataFrame, case: str) -> int:
    return int(summary.loc[summary["case"] == case, "satisfied"].sum())


def _counts(summary: pd.DataFrame, cases: list[str]) -> str:
    seeds = summary["case"].value_counts()
    counts = (
        f"{case} on {_satisfied(summary, case)} of {seeds[case]} seeds (mean final robustness "
        f"{_mean(summary, case, FINAL):.3f})"
        for case in cases
    )
    return f"The mean policy satisfies the spec with {', '.join(counts)}."


def _superior(rows: list[Comparison]) -> str:
    """What the measured differences say of "A is better than every B"."""
    seeds = min(row.seeds for row in rows)
    if not all(row.difference > 0 for row in rows):
        return "not confirmed"
    if all(row.p < SIGNIFICANT for row in rows):
        return f"confirmed (n = {seeds}, p < {SIGNIFICANT:g})"
    return (
        f"so it was with n = {seeds}, too few seeds or too much alike to tell (largest p {max(r.p for r in rows):.2f})"
    )


def _probability(p: float) -> str:
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def _table(rows: list[Comparison]) -> list[str]:
    if not rows:
        return []
    return [
        "| A | B | measure | n | A - B | P(A > B) | p |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {c.better} | {c.other} | {c.measure} | {c.seeds} | {c.difference:+.3f} | {c.wins:.2f} "
            f"| {_probability(c.p)} |"
            for c in rows
        ),
        "",
    ]


def page(name: str, summary: pd.DataFrame) -> str:
    """claims.md of the experiment `name`."""
    lines = claim_lines(summary) or ["", "The case study claims nothing of these cases.", ""]
    return "\n".join([f"# {name}", *lines])


def main(arguments: list[str]) -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.claims", description="The case study's claims, judged.")
    parser.add_argument("folders", nargs="+", type=Path, help="folders of experiments such as runs/reach_avoid")
    folders = parser.parse_args(arguments).folders
    pages = {}
    for folder in folders:
        try:
            summary, notes = read_summary(folder)
        except UserError as error:
            print(error, file=sys.stderr)
            return 2
        pages[folder] = page(folder.resolve().name, summary)
        for note in notes:
            print(note, file=sys.stderr)
    for folder, text in pages.items():
        write_text(folder / PAGE, text)
        print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
