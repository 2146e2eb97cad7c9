"""`tltl check SPEC [TRACE.csv]`: what a spec needs and says, and how one recorded trajectory fares under it."""

import json
import math
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from tltlrl.errors import UserError, shown
from tltlrl.logic import Explanation, Spec, load_spec
from tltlrl.logic.trace import Arrays, Recording, columns, read_recording
from tltlrl.logic.traps import unequal_scales
from tltlrl.resources import spec_path, user_path

Array = np.ndarray[Any, np.dtype[np.float64]]
PICTURES = (".png", ".pdf", ".svg")

EXIT_CODES = """\
exit codes:
  0  the spec is well-formed and, with a trace, satisfied (robustness > 0)
  1  the trace does not satisfy the spec (robustness <= 0)
  2  something in the spec, the trace or the command has to be corrected: one message says what

A trace is a CSV file with one row per sample and named columns, separated by commas, semicolons or tabs: a scalar
signal's column has its name, a vector signal's components are ee.x, ee.y, ee.z or ee[0], ee[1], ..., else ee_x or
ee_0, ...; --signal says other names. Other columns and lines that begin with # are ignored. Or it is an NPZ file with
an array for each signal, (T,) or (T, d). Where the spec counts in seconds, a column or array time (or t), in seconds,
says how far apart samples are.
"""


def add_spec(parser: ArgumentParser) -> None:
    """Adds the arguments for the spec and the values of its constants, which `constants_from` reads."""
    parser.add_argument("spec", metavar="SPEC", help="a .tltl file: a path of your own, or one that comes with tltlrl")
    parser.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="override a constant: goal_radius=0.3, goal=[1,2], goal.r=[1,2]; may be repeated",
    )


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl check`."""
    parser.epilog = EXIT_CODES
    add_spec(parser)
    parser.add_argument("trace", metavar="TRACE.csv", nargs="?", type=user_path, help="one recorded trajectory")
    parser.add_argument(
        "--signal",
        metavar="NAME=COLUMNS",
        action="append",
        default=[],
        help="columns of a signal that have other names: ee=pose.x,pose.y; may be repeated",
    )
    parser.add_argument(
        "--plot",
        metavar="FILE",
        type=user_path,
        help=f"draw signals and sub-formulas over time ({', '.join(PICTURES)})",
    )


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: for exit code 2.
    """
    return check(
        arguments.spec,
        arguments.trace,
        constants_from(arguments.set),
        arguments.plot,
        names=columns_from(arguments.signal),
    )


def check(
    path: str | Path,
    trace_path: str | Path | None = None,
    constants: Mapping[str, object] | None = None,
    plot: str | Path | None = None,
    out: TextIO | None = None,
    names: Mapping[str, list[str]] | None = None,
) -> int:
    """Checks a spec and, if given, a trace.

    Args:
      path: path of a .tltl file, or a name, as for `read_spec`.
      trace_path: path of a CSV or NPZ file.
      constants: values in place of the spec's own.
      plot: where to draw the trace, if anywhere.
      out: where to print, standard output if not given.
      names: signal => names of its columns in the trace, where these are not the usual ones.

    Returns:
      The exit code 0 or 1 (see EXIT_CODES).

    Raises:
      UserError: for a spec, a trace or a file that has to be mended.
    """
    out = out or sys.stdout
    if plot is not None:
        _check_picture(Path(plot), trace_path)
    spec = read_spec(str(path), constants)
    if trace_path is None:
        print(shown(described(spec)), file=out)
        return 0
    recording = read_recording(trace_path)
    if spec.counts_seconds:
        spec = as_sampled(spec, recording)
    print(shown(described(spec)), file=out)
    signals = recording.signals(spec.signals, names)
    (why,) = spec.explain(signals)
    steps = next(iter(signals.values())).shape[1]
    print(shown(judged(why, f"{trace_path}, {steps} samples", warnings(spec, signals))), file=out)
    if plot is not None:
        from tltlrl.reports.trace import draw  # Matplotlib takes longer than the rest of the command

        draw(spec, signals, why, plot)
        print(shown(f"picture      {plot}"), file=out)
    return 0 if why.satisfied else 1


def read_spec(name: str, constants: Mapping[str, object] | None = None) -> Spec:
    """Reads a spec: the user's own file if there is one at that path, otherwise the shipped spec of that name.

    Raises:
      UserError: if there is no such spec, or it cannot be read.
    """
    path = user_path(name)
    if path.is_char_device():
        raise UserError(f"{name}: the spec is a device; expected a file; give the path of a .tltl file")
    try:
        return load_spec(path if path.exists() else spec_path(name), constants)
    except OSError as error:
        raise UserError(f"{name}: the spec cannot be read: {error.strerror}; give the path of a .tltl file") from None


def as_sampled(spec: Spec, recording: Recording | Arrays) -> Spec:
    """The spec with the sampling period of a recording.

    Raises:
      UserError: if spec and recording have different periods, or neither has one.
    """
    period = recording.period()
    if period is None:
        if spec.period is None:
            raise UserError(
                f"{recording.place}: the spec counts in seconds, and there is no column of times; "
                "expected one named time, in seconds; add it, or write for instance 'period 0.05 s' into the spec"
            )
        return spec
    if spec.period is None:
        return spec.sampled(period)
    if not math.isclose(spec.period, period, rel_tol=0.01):
        raise UserError(
            f"{recording.place}: the samples are {period:.6g} s apart, but the spec says "
            f"{spec.period:.12g} s; expected one period; correct one of them"
        )
    return spec


def _check_picture(plot: Path, trace_path: str | Path | None) -> None:
    """Checks that there is something to draw and a place for it, before anything is evaluated.

    Raises:
      UserError: if there is not.
    """
    if trace_path is None:
        raise UserError("--plot draws a trace, and none was given; add a TRACE.csv")
    if plot.suffix.lower() not in PICTURES:
        raise UserError(f"{plot}: the picture's path ends in {plot.suffix!r}; expected one of {', '.join(PICTURES)}")
    if not plot.parent.is_dir():
        raise UserError(f"{plot}: there is no folder {plot.parent} for the picture; make it or give another path")


def constants_from(settings: list[str]) -> dict[str, object]:
    """`["goal.r=[1,2]", "radius=0.3"]` as `{"goal": {"r": [1, 2]}, "radius": 0.3}`.

    Raises:
      UserError: if a value cannot be read, or a name is given twice.
    """
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


def columns_from(settings: list[str]) -> dict[str, list[str]]:
    """`["ee=pose.x,pose.y"]` as `{"ee": ["pose.x", "pose.y"]}`.

    Raises:
      UserError: if a name is missing or given twice.
    """
    names: dict[str, list[str]] = {}
    for setting in settings:
        name, _, own = setting.partition("=")
        found = [column.strip() for column in own.split(",")]
        if name.strip() in names or not name.strip() or not all(found):
            raise UserError(
                f"--signal {setting}: expected each signal once, with its columns; write NAME=COLUMN,COLUMN"
            )
        names[name.strip()] = found
    return names


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
    kinds |= dict.fromkeys(spec.booleans, "true or false")
    sections = [
        ("spec", [str(spec.path)]),
        ("formula", [spec.formula]),
        ("named", [f"{name}: {text}" for name, text in spec.definitions.items()]),
        ("signals", [f"{name}, {kind}" for name, kind in kinds.items()]),
        (
            "constants",
            [f"{name} = {written(value)}{' s' * (name in spec.durations)}" for name, value in spec.constants.items()],
        ),
        ("period", [] if spec.period is None else [f"{spec.period:.12g} s"]),
        ("horizon", [_horizon(spec)]),
        ("warning", [f"{trap.line}:{trap.column}: {trap.text}" for trap in spec.traps]),
    ]
    return _table(sections)


def _horizon(spec: Spec) -> str:
    """How far into a trajectory its value depends on it."""
    if spec.counts_seconds and spec.period is None:
        return "depends on the sampling period"
    if spec.horizon is None:
        return "the whole trajectory"
    seconds = "" if spec.period is None else f", {spec.horizon * spec.period:.6g} s"
    samples = f"{spec.horizon + 1} samples" if spec.horizon else "sample"
    return f"the first {samples}{seconds}"


def warnings(spec: Spec, signals: Mapping[str, Array]) -> list[str]:
    """Warnings about what is easily missed in the result for one trajectory.

    Args:
      spec: a spec whose period is known.
      signals: signals of the trajectory, (1, T) or (1, T, d).
    """
    told = []
    steps = next(iter(signals.values())).shape[1]
    if spec.horizon is not None and spec.horizon >= steps:
        told.append(
            f"the formula looks at {spec.horizon + 1} samples and the trace ends after {steps}: windows are cut, X may "
            "have no next sample"
        )
    margins = {text: values[0] for text, values in spec.predicates_over_time(signals).items()}
    return told + [text for text in [unequal_scales(margins)] if text is not None]


def judged(why: Explanation, trace: str, warned: list[str]) -> str:
    """The lines about one trajectory: robustness, verdict, explanation and warnings."""
    values = [f"{value:+12.6g}  {name}" for name, value in why.definitions.items()]
    return _table(
        [
            ("trace", [trace]),
            ("robustness", [f"{why.value:+.6g}"]),
            ("verdict", [why.verdict]),
            ("explanation", [f"decided {why.decided_by} ({why.place})"]),
            ("at step 0", values),
            ("warning", warned),
        ]
    )


def _table(sections: list[tuple[str, list[str]]]) -> str:
    lines = []
    for title, entries in sections:
        for i, entry in enumerate(entries):
            lines.append(f"{title if i == 0 else '':<12} {entry}")
    return "\n".join(lines)
