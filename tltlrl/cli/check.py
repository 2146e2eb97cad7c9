"""`tltl check SPEC [TRACE.csv]`: what a spec needs and says, and how one recorded trajectory fares under it."""

import csv
import json
import math
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from tltlrl.errors import UserError, nearest
from tltlrl.logic import Explanation, Spec, load_spec

Array = np.ndarray[Any, np.dtype[np.float64]]
PICTURES = (".png", ".pdf", ".svg")

EXIT_CODES = """\
exit codes:
  0  the spec is well-formed and, with a trace, satisfied (robustness > 0)
  1  the trace does not satisfy the spec (robustness <= 0)
  2  something in the spec, the trace or the command has to be mended: one message says what

A trace is a CSV file with one row per sample and named columns: a scalar signal's column has its name, a vector
signal's components are ee.x, ee.y, ee.z or ee[0], ee[1], ...; other columns are ignored.
"""


def add_parser(subparsers: Any) -> None:
    """Add the sub-command `check` to a parser's sub-commands; `command(arguments)` of its result does the work."""
    parser: ArgumentParser = subparsers.add_parser(
        "check",
        help="check a spec and, with a trace, print robustness, verdict and explanation",
        description=__doc__,
        epilog=EXIT_CODES,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("spec", metavar="SPEC", help="a .tltl file")
    parser.add_argument("trace", metavar="TRACE.csv", nargs="?", help="one recorded trajectory")
    parser.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="override a constant: goal_radius=0.3, goal=[1,2], goal.r=[1,2]; may be repeated",
    )
    parser.add_argument("--plot", metavar="FILE", help="draw signals and sub-formulas over time (.png, .pdf, .svg)")
    parser.set_defaults(command=run)


def run(arguments: Namespace) -> int:
    """The sub-command; returns its exit code, raises UserError, SpecError or TraceError for code 2."""
    return check(arguments.spec, arguments.trace, constants_from(arguments.set), arguments.plot)


def check(
    spec_path: str | Path,
    trace_path: str | Path | None = None,
    constants: Mapping[str, object] | None = None,
    plot: str | Path | None = None,
    out: TextIO | None = None,
) -> int:
    """Check a spec and, if given, a trace; print to `out` (stdout). Returns the exit code 0 or 1 (see EXIT_CODES).

    Raises UserError for a spec, a trace or a file that has to be mended.
    """
    out = out or sys.stdout
    if plot is not None:
        _check_picture(Path(plot), trace_path)
    try:
        spec = load_spec(spec_path, constants)
    except OSError as error:
        raise UserError(
            f"{spec_path}: the spec cannot be read: {error.strerror}; give the path of a .tltl file"
        ) from None
    print(described(spec), file=out)
    if trace_path is None:
        return 0
    signals = read_trace(trace_path, spec.signals)
    (why,) = spec.explain(signals)
    steps = next(iter(signals.values())).shape[1]
    print(judged(why, f"{trace_path}, {steps} samples"), file=out)
    if plot is not None:
        draw(spec, signals, why, plot)
        print(f"picture      {plot}", file=out)
    return 0 if why.satisfied else 1


def _check_picture(plot: Path, trace_path: str | Path | None) -> None:
    """Whether there will be something to draw and a place for it, before anything is evaluated. Raises UserError."""
    if trace_path is None:
        raise UserError("--plot draws a trace, and none was given; add a TRACE.csv")
    if plot.suffix.lower() not in PICTURES:
        raise UserError(f"{plot}: the picture's path ends in {plot.suffix!r}; expected one of {', '.join(PICTURES)}")
    if not plot.parent.is_dir():
        raise UserError(f"{plot}: there is no folder {plot.parent} for the picture; make it or give another path")


def constants_from(settings: list[str]) -> dict[str, object]:
    """`["goal.r=[1,2]", "radius=0.3"]` as `{"goal": {"r": [1, 2]}, "radius": 0.3}`. Raises UserError."""
    constants: dict[str, object] = {}
    for setting in settings:
        key, _, value = setting.partition("=")
        name, _, label = key.partition(".")
        try:
            number = json.loads(value)
        except (ValueError, RecursionError):
            raise UserError(f"--set {setting}: not a number or a list; write NAME=0.3 or NAME=[1,2]") from None
        family = constants.setdefault(name, {}) if label else constants
        if not isinstance(family, dict) or (label or name) in family:
            raise UserError(f"--set {setting}: {name} is set before; expected each once; delete one")
        family[label or name] = number
    return constants


def columns(name: str, dimension: int | None) -> list[str]:
    """The names of a signal's columns in a trace."""
    if dimension is None:
        return [name]
    return [f"{name}.{'xyz'[i]}" if dimension <= 3 else f"{name}[{i}]" for i in range(dimension)]


def read_trace(path: str | Path, signals: Mapping[str, int | None]) -> dict[str, Array]:
    """One trajectory's signals, (1, T) or (1, T, d), from a CSV file. Raises UserError with the line and column."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, row) for row in reader if row]
    except OSError as error:
        raise UserError(f"{path}: the trace cannot be read: {error.strerror}; give the path of a CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: the trace is no CSV text: {error}; save it as CSV in UTF-8") from None
    if not lines:
        raise UserError(f"{path}:1:1: the file is empty; expected a row of column names, then one row per sample")
    (top, first), *samples = lines
    header = [name.strip() for name in first]
    if not samples:
        raise UserError(f"{path}:{top + 1}:1: there are no samples; expected one row of numbers per sample")
    for line, row in samples:
        if len(row) != len(header):
            raise UserError(
                f"{path}:{line}:{min(len(row), len(header)) + 1}: the row has {_cells(len(row))}; expected "
                f"{len(header)}, as the header; "
                + ("write decimal points, not commas" if len(row) > len(header) else "complete it or delete it")
            )

    def column(*spellings: str) -> list[float]:
        places = [place for place, name in enumerate(header) if name in spellings]
        if not places:
            raise UserError(f"{path}:{top}:1: there is no column {spellings[0]}{nearest(spellings[0], header)}")
        if len(places) > 1:
            raise UserError(
                f"{path}:{top}:{places[1] + 1}: there are {len(places)} columns {spellings[0]}; expected one; "
                "delete or rename the others"
            )
        return [_number(f"{path}:{line}:{places[0] + 1}", header[places[0]], row[places[0]]) for line, row in samples]

    trace: dict[str, Array] = {}
    for name, dimension in signals.items():
        if dimension is None:
            trace[name] = np.array([column(name)])
        else:
            parts = [column(own, f"{name}[{i}]") for i, own in enumerate(columns(name, dimension))]
            trace[name] = np.stack(parts, axis=1)[None]
    return trace


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count} cells"


def _number(place: str, name: str, cell: str) -> float:
    try:
        number = math.nan if "_" in cell else float(cell)  # Python reads 1_000 as 1000
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise UserError(f"{place}: {name} is {cell!r}; expected a finite number; repair the recording") from None
    return number


def described(spec: Spec) -> str:
    """What a spec needs, and its formula as it was read."""

    def written(value: object) -> str:
        if isinstance(value, Mapping):
            return "{" + ", ".join(f"{label}: {written(v)}" for label, v in value.items()) + "}"
        if isinstance(value, tuple):
            return "(" + ", ".join(map(written, value)) + ")"
        return f"{value:g}"

    kinds = {
        name: "number" if d is None else f"vector of {d}: columns {', '.join(columns(name, d))}"
        for name, d in spec.signals.items()
    }
    horizon = spec.horizon
    sections = [
        ("spec", [str(spec.path)]),
        ("formula", [spec.formula]),
        ("named", [f"{name}: {text}" for name, text in spec.definitions.items()]),
        ("signals", [f"{name}, {kind}" for name, kind in kinds.items()]),
        ("constants", [f"{name} = {written(value)}" for name, value in spec.constants.items()]),
        ("horizon", ["the whole trajectory" if horizon is None else f"the first {horizon + 1} samples"]),
    ]
    return _table(sections)


def judged(why: Explanation, trace: str) -> str:
    """Robustness, verdict and explanation of one trajectory."""
    values = [f"{value:+12.6g}  {name}" for name, value in why.definitions.items()]
    return _table(
        [
            ("trace", [trace]),
            ("robustness", [f"{why.value:+.6g}"]),
            ("verdict", [why.verdict]),
            ("explanation", [f"decided {why.decided_by} ({why.place})"]),
            ("at step 0", values),
        ]
    )


def _table(sections: list[tuple[str, list[str]]]) -> str:
    lines = []
    for title, entries in sections:
        for i, entry in enumerate(entries):
            lines.append(f"{title if i == 0 else '':<12} {entry}")
    return "\n".join(lines)


def draw(spec: Spec, signals: Mapping[str, Array], why: Explanation, path: str | Path) -> None:
    """Signals and sub-formulas over time, the deciding moment marked. Raises UserError if it cannot be saved."""
    from matplotlib.figure import Figure

    curves = {**spec.definitions_over_time(signals), "spec": spec.robustness_over_time(signals)}
    panels = len(signals) + 1
    figure = Figure(figsize=(8, 1.6 * len(signals) + 3.2), layout="constrained")
    axes = figure.subplots(panels, 1, sharex=True, squeeze=False, height_ratios=[1.0] * len(signals) + [2.0])[:, 0]
    styles = ["-", "--", "-.", ":"]
    greys = ["0.0", "0.35", "0.6"]
    for axis, (name, values) in zip(axes[:-1], signals.items(), strict=True):
        own = columns(name, spec.signals[name])
        for i, (label, curve) in enumerate(zip(own, values[0].reshape(len(values[0]), -1).T, strict=True)):
            axis.plot(curve, styles[i % 4], color=greys[i // 4 % 3], linewidth=1.2, label=_entry(label))
        axis.set_ylabel(name)
        axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    last = axes[-1]
    for i, (name, values) in enumerate(curves.items()):
        finite = np.where(np.isfinite(values[0]), values[0], np.nan)
        is_spec = name == "spec"
        last.plot(
            finite,
            "-" if is_spec else styles[(i + 1) % 4],
            color="tab:red" if is_spec else greys[i // 4 % 3],
            linewidth=2.2 if is_spec else 1.2,
            label=_entry(name),
        )
    last.axhline(0, color="0.7", linewidth=0.8, zorder=0)
    for axis in axes:
        axis.axvline(why.step, color="tab:red", linewidth=0.8, linestyle=(0, (1, 2)))
        axis.spines[["top", "right"]].set_visible(False)
    if why.margin is not None:
        # On the predicate's own curve, where its sub-formula has one: a negation turns the value's sign.
        last.plot(why.step, why.margin, "o", color="tab:red", markersize=7, markerfacecolor="white", zorder=5)
    last.set_title(f"decided {why.decided_by}", fontsize=9, loc="left")
    last.set_xlabel("step")
    last.set_ylabel("robustness from here on")
    last.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    axes[0].set_title(
        f"{spec.formula if len(spec.formula) < 70 else 'spec'}: {why.value:+.4g}", fontsize=10, loc="left"
    )
    try:
        figure.savefig(path, dpi=150)
    except OSError as error:
        raise UserError(f"{path}: the picture cannot be saved: {error.strerror}; give another path") from None


def _entry(label: str) -> str:
    """A legend's entry: Matplotlib leaves out those that begin with _."""
    return f" {label}"
