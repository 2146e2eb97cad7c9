"""report.html: an experiment as one page that needs no network and no other file."""

from __future__ import annotations

import base64
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tltlrl.learning.policy import Policy
from tltlrl.logic.reasons import from_json
from tltlrl.reports.charts import Line, chart
from tltlrl.reports.clauses import Standing, averaged, stuck
from tltlrl.reports.comparison import compare
from tltlrl.reports.interval import LEVEL, mean_interval, share_interval
from tltlrl.reports.motion import watch
from tltlrl.reports.player import player
from tltlrl.reports.plotting import LABELS, PANELS, near_zero
from tltlrl.reports.report import (
    HOW_DECIDED,
    ITERATIONS,
    OF_THE_MOTION,
    Tables,
    judged_besides,
    measured,
    median_iteration,
    median_run,
    medians_of_motion,
)
from tltlrl.simulation.motion import MEASURES
from tltlrl.simulation.simulator import simulator_of
from tltlrl.store.clauses import CLAUSE, DECIDES
from tltlrl.store.files import write_text
from tltlrl.store.layout import CALM, PAGE, WORKSPACE, run_of
from tltlrl.training.build import make_task
from tltlrl.training.learned import learned_policy
from tltlrl.training.study import Study

CLAIMS = "claims.md"
FILMS = {".mp4": "video/mp4", ".gif": "image/gif"}
LARGEST = 3_000_000  # bytes, of a film or picture that is taken into the page
NUMBER = ' class="number"'
NOTHING = "default-src 'none'; img-src data:; media-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


@dataclass(frozen=True)
class Provenance:
    """How an experiment was made.

    Attributes:
      commands: the command of every session that computed runs.
      facts: what it was computed with, name => text.
      settings: key => value, with nested keys joined by dots.
      defaults: the settings without the user's choices; empty if not known.
    """

    commands: Sequence[Sequence[str]]
    facts: Mapping[str, str]
    settings: Mapping[str, Any]
    defaults: Mapping[str, Any]


def write_page(
    folder: Path,
    study: Study,
    tables: Tables,
    finished: Mapping[Path, Mapping[str, Any]],
    failures: Mapping[str, str],
    provenance: Provenance,
) -> None:
    """Writes report.html into the experiment's folder.

    Args:
      folder: folder of the experiment, with its pictures.
      study: what was asked for.
      tables: tables of the finished runs.
      finished: folder of a run => its results.
      failures: run => message.
      provenance: how it was made.
    """
    summary = tables.summary
    sections = {
        "Verdict": _verdict(study, summary, failures),
        "Learning curves": _curves(tables.curves),
        "Clauses": _clauses(study, finished, tables.standings),
        "Motions": _motions(folder, study, finished),
        "Measures of motion": _measures(summary),
        "Trials": _trials(study, summary, finished),
        "Statistics": _statistics(summary, folder),
        "Configuration": _configuration(provenance),
    }
    there = {title: body for title, body in sections.items() if body}
    links = "".join(f'<a href="#{title.replace(" ", "-")}">{title}</a>' for title in there)
    body = "".join(
        f'<section aria-labelledby="{title.replace(" ", "-")}"><h2 id="{title.replace(" ", "-")}">{title}</h2>{text}'
        "</section>"
        for title, text in there.items()
    )
    own = files("tltlrl.reports")
    name = escape(study.name)
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        f'content="width=device-width, initial-scale=1"><meta http-equiv="Content-Security-Policy" content="{NOTHING}">'
        f"<title>{name}</title><style>{own.joinpath('page.css').read_text(encoding='utf-8')}</style></head><body>"
        f'<h1>{name}</h1><nav aria-label="sections">{links}</nav><main>{body}</main>'
        f"<script>{own.joinpath('page.js').read_text(encoding='utf-8')}</script></body></html>\n"
    )
    write_text(folder / PAGE, page)


def _label(case: object) -> str:
    return LABELS.get(str(case), str(case))


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], name: str) -> str:
    """A table; cells are HTML, and numbers where they begin like one, without a reason after it, or are "never"."""
    top = "".join(f'<th scope="col">{cell}</th>' for cell in head)
    body = "".join(
        "<tr>"
        + "".join(f"<td{NUMBER if re.match(r'[-+]?[0-9][^:]*$|never$', cell) else ''}>{cell}</td>" for cell in row)
        + "</tr>"
        for row in rows
    )
    return (
        f'<div class="wide" role="region" tabindex="0" aria-label="{name}"><table><thead><tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _rate(successes: int, trials: int) -> str:
    low, high = share_interval(successes, trials)
    return f"{successes} of {trials} ({100 * low:.0f} to {100 * high:.0f} %)"


def _verdict(study: Study, summary: pd.DataFrame, failures: Mapping[str, str]) -> str:
    rows = []
    for case, own in summary.groupby("case", sort=False):
        met, count, worth = int(own["satisfied"].sum()), len(own), own["robustness_policy"]
        style = "good" if met == count else "bad" if met == 0 else ""
        rows.append(
            [
                escape(_label(case)),
                f'<span class="{style}">{met} of {count} seeds</span>',
                f"{worth.median():+.3f} ({worth.min():+.3f} to {worth.max():+.3f})",
                *(median_iteration(own[name]) for name in ITERATIONS),
                _rate(int(own["successes"].sum()), int(own["trials"].sum())),
            ]
        )
    head = [
        "case", "satisfies the spec", "robustness, median (min to max)", "first satisfied, iteration, median",
        "satisfied for good from, median",
        "successful trials (95 % Wilson)",
    ]  # fmt: skip
    failed = "".join(f"<li>{escape(run)}: {escape(message)}</li>" for run, message in failures.items())
    return (
        f"<p>Spec <code>{escape(study.spec.formula)}</code> on <code>{escape(study.task.name)}</code>: "
        f"{len(study.seeds)} seed{'s' * (len(study.seeds) > 1)}, {study.algorithm.iterations} iterations of "
        f"{study.algorithm.samples} samples. Robustness is that of the spec, whatever a case was trained on; above 0 "
        f"the spec is satisfied. Of the mean policy without noise, except the trials.</p>"
        + _table(head, rows, "verdict")
        + (f"<p>Failed runs:</p><ul>{failed}</ul>" if failed else "")
    )


def _curves(curves: pd.DataFrame) -> str:
    parts = []
    for measure, of in PANELS.items():
        lines = []
        for case, own in curves.groupby("case", sort=False):
            table = own.pivot(index="iteration", columns="seed", values=measure)
            values = table.where(np.isfinite(table)).to_numpy(dtype=float)
            lines.append(Line(_label(case), values.mean(axis=1), values.T, mean_interval(values)))
        iterations = np.sort(curves["iteration"].unique()).astype(float)
        finite = curves.loc[np.isfinite(curves[measure]), measure]
        near = near_zero(curves, measure)
        low = min((float(line.y[len(line.y) // 4 :].min()) for line in lines), default=0.0) if near else finite.min()
        whole = (low if np.isfinite(low) else float(finite.min()), max(float(finite.max()), 0.0))
        ends = "; ".join(f"{line.name} ends at {line.y[-1]:+.3f}" for line in lines)
        for limits, more in ((whole, ""), (near, ", near 0")):
            if limits is None:
                continue
            margin = 0.05 * ((limits[1] - limits[0]) or 1.0)
            text = f"Robustness of {of}{more} against iterations: {ends}."
            name = f"curve-{measure}{'-near' if more else ''}"
            drawn = chart(name, iterations, lines, (limits[0] - margin, limits[1] + margin), text, "robustness")
            cut = " Lower values are cut off." if near else ""
            parts.append(
                f"<figure><h3>{of.capitalize()}{more}</h3>{drawn}<figcaption>{escape(ends)}.{cut}</figcaption></figure>"
            )
    count = int(curves.groupby("case")["seed"].nunique().max())
    thick = f"Thick: mean of {count} seeds; thin: each seed" if count > 1 else "One seed"
    band = f"; band: {100 * LEVEL:.0f} % t interval of the mean, of 6 seeds or more" if count > 5 else ""
    return (
        f'<div class="views">{"".join(parts)}</div><p class="quiet">{thick}{band}. In the unit of the predicates.</p>'
    )


def _clauses(
    study: Study, finished: Mapping[Path, Mapping[str, Any]], known: Mapping[str, Mapping[int, Standing]]
) -> str:
    parts = []
    for case, runs in known.items():
        mean = averaged(list(runs.values()))
        lines = [Line(clause, 100 * mean.values(CLAUSE, DECIDES, clause)) for clause in mean.clauses]
        ends = "; ".join(f"{line.name} ends at {line.y[-1]:.0f} %" for line in lines)
        iterations = mean.table["iteration"].to_numpy(dtype=float)
        text = f"Share of samples that each clause decides, {_label(case)}: {ends}."
        drawn = chart(f"clauses-{case}", iterations, lines, (-3.0, 103.0), text, "decides, % of samples")
        parts.append(f"<figure><h3>{escape(_label(case))}</h3>{drawn}<figcaption>{escape(ends)}.</figcaption></figure>")
    said = []
    for path, done in finished.items():
        case, seed = run_of(path)
        if not done["satisfied"] and seed in known.get(case, {}):
            told = stuck(known[case][seed], study.spec.asks_for, study.algorithm.samples)
            said.append(f"<li>{escape(_label(case))}, seed {seed}: {_code(told)}.</li>")
    if not parts:
        return ""
    failed = f"<p>Of the sampled trajectories of each failed seed:</p><ul>{''.join(said)}</ul>" if said else ""
    return (
        "<p>A clause decides a trajectory whose robustness is its own. Means over the seeds.</p>"
        f'<div class="views">{"".join(parts)}</div>{failed}'
    )


def _code(text: str) -> str:
    """Plain text with `code` in it."""
    return re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text))


def _motions(folder: Path, study: Study, finished: Mapping[Path, Mapping[str, Any]]) -> str:
    task = make_task(study.task)
    simulator = simulator_of(task)

    def played(identifier: str, policy: Policy, name: str) -> str:
        motion = watch(task, study.spec, policy, simulator)
        return (
            f"<h3>{escape(name)}</h3><p>Robustness {motion.why.value:+.3f}, decided "
            f"{escape(motion.why.decided_by)}.</p>{player(identifier, task, motion, name)}"
        )

    parts = []
    for case in dict.fromkeys(run_of(path)[0] for path in finished):
        median = median_run(finished, case)
        assert median is not None
        name = f"{_label(case)}, seed {run_of(median)[1]}"
        learned = played(f"motion-{case}", learned_policy(median), name)
        calm = ""
        if "calm" in finished[median]:
            calm = played(f"motion-{case}-calm", learned_policy(median, CALM), f"{name}, calm")
        picture = _embedded(folder / case / f"{WORKSPACE}.png", "image/png", f"Workspace of {name}")
        film = next((_embedded(median / f"motion{kind}", mime, f"Film of {name}") for kind, mime in FILMS.items()
                     if (median / f"motion{kind}").exists()), "")  # fmt: skip
        parts.append(f"{learned}{film}{picture}{calm}")
    return f"<p>Of each case the seed with the median robustness, without noise.</p>{''.join(parts)}" if parts else ""


def _measures(summary: pd.DataFrame) -> str:
    names = measured(summary)
    if not names:
        return ""
    rows = [
        [escape(_label(case)) + ", calm" * is_calm, *medians] for case, is_calm, medians in medians_of_motion(summary)
    ]
    units = "".join(f"<li>{escape(name)}: {escape(MEASURES[column])}</li>" for column, name in names.items())
    table = _table(["case", *names.values()], rows, "measures of motion")
    return f"<p>{OF_THE_MOTION}</p>{table}<ul class='quiet'>{units}</ul>"


def _embedded(path: Path, mime: str, text: str) -> str:
    """A picture or film embedded in the page; empty if there is none, or it is too large."""
    if not path.exists() or not 0 < path.stat().st_size <= LARGEST:
        return ""
    source = f"data:{mime};base64,{base64.b64encode(path.read_bytes()).decode()}"
    if mime.startswith("video"):
        return f'<figure><video controls src="{source}" aria-label="{escape(text)}"></video></figure>'
    return (
        f'<figure><details><summary>{escape(text)}</summary><img loading="lazy" alt="{escape(text)}" src="{source}">'
        "</details></figure>"
    )


def _trials(study: Study, summary: pd.DataFrame, finished: Mapping[Path, Mapping[str, Any]]) -> str:
    task, besides = make_task(study.task), judged_besides(summary)
    rows = []
    for (_, row), done in zip(summary.iterrows(), finished.values(), strict=True):
        why = "; ".join(f"{r.count}: {r.told(task.control_timestep)}" for r in from_json(done["why_trials_fail"]))
        rows.append(
            [
                escape(_label(row["case"])),
                f"{row['seed']}",
                _rate(int(row["successes"]), int(row["trials"])),
                *(f"{row[name]} of {row['trials']}" for name in besides),
                _code(why),
            ]
        )
    head = ["case", "seed", "successful trials (95 % Wilson)", *(f"with {name.replace('_', ' ')}" for name in besides)]
    return _table([*head, "why trials failed"], rows, "trials") + f"<p class='quiet'>Why: {_code(HOW_DECIDED)}</p>"


def _statistics(summary: pd.DataFrame, folder: Path) -> str:
    cases = list(dict.fromkeys(summary["case"]))
    parts = []
    if len(cases) > 1:
        pairs = [(cases[0], other) for other in cases[1:]]
        for measure, title in (
            ("robustness_policy", "Robustness of the mean policy at the end"),
            ("robustness_mean_over_run", "Robustness of the samples, mean over the run"),
        ):
            rows = [
                [
                    escape(f"{_label(each.better)} − {_label(each.other)}"),
                    f"{each.difference:+.3f}",
                    f"{each.wins:.2f}",
                    f"{each.p:.3g}",
                    f"{each.seeds}",
                ]
                for each in compare(summary, pairs, measure)
            ]
            head = ["difference", "mean over seeds", "P(first is better)", "p", "common seeds"]
            parts.append(f"<h3>{title}</h3>{_table(head, rows, title)}")
        parts.append(
            '<p class="quiet">p: paired permutation test of the mean difference over common seeds, two-sided, '
            "Holm-corrected within each table; with n seeds it cannot be below 2^(1 − n) times the number of rows.</p>"
        )
    if (folder / CLAIMS).exists():
        text = (folder / CLAIMS).read_text(encoding="utf-8", errors="replace")
        parts.append(f"<h3>Claims</h3><pre>{escape(text)}</pre>")
    return "".join(parts)


def _configuration(provenance: Provenance) -> str:
    commands = "\n".join(shlex.join(command) for command in provenance.commands)
    rows = []
    for key, value in provenance.settings.items():
        changed = key not in provenance.defaults or provenance.defaults[key] != value
        said = escape(str(value))
        other = escape(str(provenance.defaults.get(key, "none"))) if changed else ""
        rows.append((changed, [f"<code>{escape(key)}</code>", f"<code>{said}</code>", f"<code>{other}</code>"]))
    head = ["key", "value", "default"]
    facts = "".join(f"<li>{escape(name)}: {escape(text)}</li>" for name, text in provenance.facts.items())
    if not provenance.defaults:
        tables = _table(head[:2], [row[:2] for _, row in rows], "settings")
    else:
        differs, same = ([row for changed, row in rows if changed is wanted] for wanted in (True, False))
        tables = (
            f"<h3>What differs from the defaults</h3>{_table(head, differs, 'what differs from the defaults')}"
            f"<details><summary>The {len(same)} settings that do not differ</summary>"
            f"{_table(head[:2], [row[:2] for row in same], 'other settings')}</details>"
        )
    return f"<p>The command that repeats it:</p><pre>{escape(commands)}</pre>{tables}<ul>{facts}</ul>"
