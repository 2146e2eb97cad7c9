"""`tltl watch SPEC`: robustness of a trajectory while it runs, from samples on standard input, line by line."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable, Mapping
from io import TextIOWrapper
from pathlib import Path
from typing import TextIO

from tltlrl.cli.check import add_spec, constants_from, read_spec
from tltlrl.errors import UserError
from tltlrl.logic import Explanation, TraceError
from tltlrl.logic.online.monitor import Reading
from tltlrl.logic.online.stream import samples

NOTES = """\
Standard input holds one sample per line: CSV with a header whose columns are named as for tltl check, or JSON objects
such as {"ee": [0.1, 0.2], "gripper": 3}. Each sample is answered at once with one line: its number; the robustness if
the trajectory ended there; the lower and the upper bound that hold however it goes on; and what decides the
robustness. A line that is no sample is left out, with a message on standard error. Ctrl-C ends the trajectory.

exit codes:
  0  the trajectory satisfies the spec (robustness > 0), or the reader of the output closed it
  1  it does not (robustness <= 0)
  2  something in the spec, the header or the command has to be corrected, or there was no sample
"""


def add_arguments(parser: ArgumentParser) -> None:
    """Adds the arguments of `tltl watch`."""
    parser.epilog = NOTES
    add_spec(parser)
    parser.add_argument(
        "--period", metavar="SECONDS", type=float, help="time between two samples, for bounds in seconds"
    )


def run(arguments: Namespace) -> int:
    """The command; returns its exit code.

    Raises:
      UserError: for exit code 2.
    """
    if isinstance(sys.stdin, TextIOWrapper):  # a byte that is not text makes one bad line; the stream goes on
        sys.stdin.reconfigure(encoding="utf-8", errors="replace")
    return watch(arguments.spec, sys.stdin, constants_from(arguments.set), arguments.period)


def watch(
    path: str | Path,
    lines: Iterable[str],
    constants: Mapping[str, object] | None = None,
    period: float | None = None,
    out: TextIO | None = None,
) -> int:
    """Prints a line for each sample in some lines of text.

    Args:
      path: path of a .tltl file.
      lines: lines of CSV or JSON.
      constants: values in place of the spec's own.
      period: time between two samples, s.
      out: where to print, standard output if not given.

    Returns:
      The exit code 0 or 1 (see NOTES).

    Raises:
      UserError: for a spec or a header that has to be mended, or if there is no sample.
    """
    out = out or sys.stdout
    if period is not None and not 0 < period < float("inf"):
        raise UserError(f"--period {period:g}: expected a positive number of seconds")
    spec = read_spec(str(path), constants)
    if period is not None:
        spec = spec.sampled(period)
    witness, why = spec.watch(), None
    try:
        for sample in samples(lines, spec.signals, "<stdin>"):
            try:
                if isinstance(sample, UserError):
                    raise sample
                reading = witness.update(sample)
            except (UserError, TraceError) as mistake:
                print(f"tltl watch: {mistake}; left out", file=sys.stderr, flush=True)
            else:
                why = witness.explanation()
                print(answer(witness.steps - 1, reading, why), file=out, flush=True)
    except KeyboardInterrupt:  # how a person ends an endless stream
        print(file=sys.stderr)
    if why is None:
        raise UserError("<stdin>: there are no samples; expected one per line, CSV with a header or JSON objects")
    print(why, file=out, flush=True)
    return 0 if why.satisfied else 1


def answer(step: int, reading: Reading, why: Explanation) -> str:
    """The line about one sample."""
    robustness, lower, upper = (f"{float(a[0]) + 0.0:+.6g}" for a in (reading.robustness, reading.lower, reading.upper))
    decided = "decided" if reading.decided[0] else "open"
    return f"{step:6}  robustness {robustness:>12}  bounds {lower:>12} {upper:>12}  {decided:7}  {why.decided_by}"
