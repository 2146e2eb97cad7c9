"""Recorded trajectories: from a CSV file to the signals of a spec."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest, printable

Array = NDArray[np.float64]
TIMES = {"time", "t", "time_s", "time [s]"}  # names of a column of times in seconds, in any case
UNEVEN = 0.5  # of the usual step: what a step may be longer or shorter, since clocks round
JITTER = 0.01  # of a step: how far a time may be from where even steps lead


def columns(name: str, dimension: int | None) -> list[str]:
    """The names of a signal's columns in a trace."""
    if dimension is None:
        return [name]
    return [f"{name}.{'xyz'[i]}" if dimension <= 3 else f"{name}[{i}]" for i in range(dimension)]


@dataclass(frozen=True)
class Recording:
    """One recorded trajectory, as text.

    Attributes:
      path: of the file.
      top: the line of the header.
      header: the columns' names.
      samples: line and cells of each row.
    """

    path: str | Path
    top: int
    header: list[str]
    samples: list[tuple[int, list[str]]]

    def signals(self, wanted: Mapping[str, int | None]) -> dict[str, Array]:
        """The signals of a spec.

        Args:
          wanted: name => dimension of a vector, None for a scalar.

        Returns:
          name => (1, T) for a scalar, (1, T, d) for a vector.

        Raises:
          UserError: with the line and column of what has to be mended.
        """
        trace: dict[str, Array] = {}
        for name, dimension in wanted.items():
            if dimension is None:
                trace[name] = np.array([self._column(name)])
            else:
                parts = [self._column(own, f"{name}[{i}]") for i, own in enumerate(columns(name, dimension))]
                trace[name] = np.stack(parts, axis=1)[None]
        return trace

    def period(self) -> float | None:
        """The time between two samples, s, by the column `time` or `t`; None if there is none, or only one sample.

        Clocks round and jitter: it is the roundest number that all times agree with, else the mean step.

        Raises:
          UserError: with the line where time does not go on evenly.
        """
        name = next((name for name in self.header if name.lower() in TIMES), None)
        if name is None or len(self.samples) < 2:
            return None
        times = np.array(self._column(name))
        steps = np.diff(times)
        if name == "t" and (steps == 1).all():  # it counts samples
            return None
        usual = float(np.median(steps))
        for problem, wrong in (
            ("runs backwards", steps < 0),
            ("stands still", steps == 0),
            ("has a gap", steps > (1 + UNEVEN) * usual),
            ("is uneven", steps < (1 - UNEVEN) * usual),
        ):
            if wrong.any():
                row = int(np.argmax(wrong))
                raise UserError(
                    f"{self.path}:{self.samples[row + 1][0]}:{self.header.index(name) + 1}: time {problem}, from "
                    f"{times[row]:.12g} to {times[row + 1]:.12g} s, where {usual:.6g} s are usual; expected even "
                    "steps; repair the recording, or resample it"
                )
        mean = float(times[-1] - times[0]) / len(steps)
        place = self.header.index(name)
        digit = 10.0 ** min(int(Decimal(row[place]).as_tuple().exponent) for _, row in self.samples)
        rates = [round(1 / mean / unit) * unit for unit in (10, 5, 1)]
        round_ones = [1 / rate for rate in rates if rate] + [float(f"{mean:.{digits}g}") for digits in (1, 2, 3)]
        for candidate in round_ones:
            off = times - times[0] - candidate * np.arange(len(times))
            if np.abs(off).max() <= max(digit, JITTER * mean):
                return candidate
        return mean

    def _column(self, *spellings: str) -> list[float]:
        places = [place for place, name in enumerate(self.header) if name in spellings]
        if not places:
            raise UserError(
                f"{self.path}:{self.top}:1: there is no column {spellings[0]}{nearest(spellings[0], self.header)}"
            )
        if len(places) > 1:
            raise UserError(
                f"{self.path}:{self.top}:{places[1] + 1}: there are {len(places)} columns {spellings[0]}; expected "
                "one; delete or rename the others"
            )
        (place,) = places
        return [
            _number(f"{self.path}:{line}:{place + 1}", self.header[place], row[place]) for line, row in self.samples
        ]


def read_recording(path: str | Path) -> Recording:
    """One trajectory, from a CSV file with one row per sample and named columns.

    Empty lines and lines that begin with # are left out; the header may be such a line, the last one before the
    numbers.

    Raises:
      UserError: if it holds no table.
    """
    try:
        if Path(path).is_char_device():
            raise UserError(f"{path}: the trace is a device; expected a file; give the path of a CSV file")
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = _rows(file)
    except OSError as error:
        raise UserError(f"{path}: the trace cannot be read: {error.strerror}; give the path of a CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"{path}: the trace is no CSV text: {error}; save it as CSV in UTF-8") from None
    if not lines:
        raise UserError(f"{path}:1:1: the file is empty; expected a row of column names, then one row per sample")
    (top, first), *samples = lines
    if not samples:
        raise UserError(f"{path}:{top + 1}:1: there are no samples; expected one row of numbers per sample")
    for line, row in samples:
        if len(row) != len(first):
            advice = "complete it or delete it"
            if len(row) > len(first):
                advice = "write decimal points, not commas" if row[-1].strip() else "delete the comma at its end"
            raise UserError(
                f"{path}:{line}:{min(len(row), len(first)) + 1}: the row has {_count(len(row))}; expected "
                f"{len(first)}, as the header; {advice}"
            )
    return Recording(path, top, [name.strip() for name in first], samples)


def _rows(file: Iterable[str]) -> list[tuple[int, list[str]]]:
    """The rows of a CSV text with their lines, without comments, the header first."""
    comment = ""
    lines: list[tuple[int, list[str]]] = []

    def without_comments() -> Iterator[str]:
        nonlocal comment
        for line in file:
            is_comment = line.lstrip().startswith("#")
            comment = line if is_comment and not lines else comment
            yield "\n" if is_comment else line

    reader = csv.reader(without_comments())
    for row in filter(None, reader):
        if not lines and comment and all(map(_is_number, row)):  # as NumPy's savetxt writes it
            (names,) = csv.reader([comment.lstrip()[1:]])
            lines.append((reader.line_num - 1, names))
        lines.append((reader.line_num, row))
    return lines


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _count(cells: int) -> str:
    return "1 cell" if cells == 1 else f"{cells} cells"


def _number(place: str, name: str, cell: str) -> float:
    truth = {"true": 1.0, "false": 0.0}.get(cell.strip().lower())
    if truth is not None:
        return truth
    try:
        number = math.nan if "_" in cell else float(cell)  # Python reads 1_000 as 1000
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        shown = f"'{printable(cell)}'"
        raise UserError(f"{place}: {name} is {shown}; expected a finite number; repair the recording") from None
    return number
