"""Reads recorded trajectories from CSV or NPZ files, as the signals of a spec."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest, printable

Array = NDArray[np.float64]
TIMES = {"time", "t", "time_s", "time [s]"}  # names of a column of times in seconds, in lower case or capitals
UNEVEN = 0.5  # share of the usual step by which a step may differ, because clocks round
JITTER = 0.01  # share of a step by which a time may differ from evenly spaced times


def columns(name: str, dimension: int | None) -> list[str]:
    """The names of a signal's columns in a trace."""
    if dimension is None:
        return [name]
    return [f"{name}.{'xyz'[i]}" if dimension <= 3 else f"{name}[{i}]" for i in range(dimension)]


def spellings(name: str, dimension: int | None) -> list[tuple[str, ...]]:
    """The allowed names of each of a signal's columns: ee.x or ee[0], or if there is neither, ee_x or ee_0."""
    flat = re.sub(r"[\[\].]+", "_", name).strip("_")
    if dimension is None:
        return [(name, name, flat)]
    return [
        (own, f"{name}[{i}]", f"{flat}_{'xyz'[i]}" if dimension <= 3 else f"{flat}_{i}", f"{flat}_{i}")
        for i, own in enumerate(columns(name, dimension))
    ]


def write_recording(path: str | Path, signals: Mapping[str, Array], period: float) -> None:
    """Writes one trajectory to a CSV file for `read_recording`, with every digit.

    Args:
      path: path of the CSV file.
      signals: name => (T,) for a scalar, (T, d) for a vector.
      period: between two samples, s.

    Raises:
      UserError: if the file cannot be written.
    """
    table: dict[str, Array] = {}
    for name, values in signals.items():
        parts = values[:, None] if values.ndim == 1 else values
        titles = columns(name, None if values.ndim == 1 else parts.shape[1])
        table |= dict(zip(titles, parts.T, strict=True))
    steps = len(next(iter(table.values())))
    try:
        with open(path, "w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["time", *table])
            for step in range(steps):
                writer.writerow([f"{step * period:.12g}", *(repr(float(values[step])) for values in table.values())])
    except OSError as error:
        raise UserError(f"{path}: the trace cannot be written: {error.strerror}; give another path") from None


@dataclass(frozen=True)
class Recording:
    """One recorded trajectory, as text.

    Attributes:
      path: path of the file.
      top: line number of the header.
      header: the columns' names.
      samples: line and cells of each row.
      has_commas: whether numbers may have decimal commas, because columns are separated by something else.
    """

    path: str | Path
    top: int
    header: list[str]
    samples: list[tuple[int, list[str]]]
    has_commas: bool = False

    @property
    def place(self) -> str:
        """Where it begins."""
        return f"{self.path}:{self.top}:1"

    def signals(
        self, wanted: Mapping[str, int | None], given: Mapping[str, Sequence[str]] | None = None
    ) -> dict[str, Array]:
        """The signals of a spec.

        Args:
          wanted: name => dimension of a vector, None for a scalar.
          given: name => names of its columns, where these are not the usual ones.

        Returns:
          name => (1, T) for a scalar, (1, T, d) for a vector.

        Raises:
          UserError: if a column is missing or a cell is wrong; it names line and column.
        """
        given = _checked(wanted, given, "columns")
        trace: dict[str, Array] = {}
        for name, dimension in wanted.items():
            names = [(own,) for own in given[name]] if name in given else spellings(name, dimension)
            parts = [self._column(*own) for own in names]
            trace[name] = np.array(parts) if dimension is None else np.stack(parts, axis=1)[None]
        return trace

    def period(self) -> float | None:
        """The time between two samples, s, from the column `time` or `t`; None without one, or with only one sample.

        Clocks round and jitter, so it is the roundest number that fits all times, or else the mean step.

        Raises:
          UserError: if times are not evenly spaced; it names the line.
        """
        name = next((name for name in self.header if name.lower() in TIMES), None)
        if name is None:
            return None
        column = self.header.index(name)
        cells = [self._plain(row[column]) for _, row in self.samples]
        digits = [Decimal(cell) for cell in cells if _is_number(cell)]
        digit = 10.0 ** min((int(d.as_tuple().exponent) for d in digits), default=0)
        places = [f"{self.path}:{line}:{column + 1}" for line, _ in self.samples]
        return _period(name, np.array(self._column(name)), digit, places)

    def _column(self, *spellings: str) -> list[float]:
        usual = [place for place, name in enumerate(self.header) if name in spellings[:2]]
        places = usual or [place for place, name in enumerate(self.header) if name in spellings[2:]]
        if not places:
            raise UserError(f"{self.place}: there is no column {spellings[0]}{nearest(spellings[0], self.header)}")
        if len(places) > 1:
            raise UserError(
                f"{self.path}:{self.top}:{places[1] + 1}: there are {len(places)} columns {spellings[0]}; expected "
                "one; delete or rename the others"
            )
        (place,) = places
        return [
            _number(f"{self.path}:{line}:{place + 1}", self.header[place], self._plain(row[place]))
            for line, row in self.samples
        ]

    def _plain(self, cell: str) -> str:
        return cell.replace(",", ".") if self.has_commas and cell.count(",") == 1 and "." not in cell else cell


@dataclass(frozen=True)
class Arrays:
    """One recorded trajectory, as arrays by name.

    Attributes:
      path: of the file.
      arrays: (T,) or (1, T) for a scalar, (T, d) or (1, T, d) for a vector.
    """

    path: str | Path
    arrays: Mapping[str, NDArray[np.generic]]

    @property
    def place(self) -> str:
        """Where it is."""
        return str(self.path)

    def signals(
        self, wanted: Mapping[str, int | None], given: Mapping[str, Sequence[str]] | None = None
    ) -> dict[str, Array]:
        """The signals of a spec, as `Recording.signals`; `given` names arrays, one of all components or one of each."""
        given = _checked(wanted, given, "arrays")
        trace: dict[str, Array] = {}
        for name, dimension in wanted.items():
            own = given.get(name, [name])
            if len(own) == 1:
                trace[name] = self._array(own[0], dimension)
            else:
                trace[name] = np.stack([self._array(part, None) for part in own], axis=2)
        return trace

    def period(self) -> float | None:
        """The time between two samples, s, from the array `time` or `t`, as in `Recording.period`."""
        name = next((name for name in self.arrays if name.lower() in TIMES), None)
        if name is None:
            return None
        times = self._array(name, None)[0]
        return _period(name, times, 0.0, [f"{self.path}: sample {i}" for i in range(len(times))])

    def _array(self, name: str, dimension: int | None) -> Array:
        if name not in self.arrays:
            raise UserError(f"{self.path}: there is no array {name}{nearest(name, self.arrays)}")
        array = self.arrays[name]
        expected = "(T,)" if dimension is None else f"(T, {dimension})"
        if array.dtype.kind not in "biuf":
            raise UserError(f"{self.path}: {name} holds {array.dtype}; expected numbers or truths; save it as floats")
        one = array[None] if array.ndim == (1 if dimension is None else 2) else array
        if (
            one.ndim != (2 if dimension is None else 3)
            or len(one) != 1
            or one.shape[2:] != (dimension,) * (one.ndim - 2)
        ):
            raise UserError(
                f"{self.path}: {name} has shape {array.shape}; expected {expected}, one trajectory; save one that is so"
            )
        if one.shape[1] == 0:
            raise UserError(f"{self.path}: {name} holds no samples; expected one at least; leave empty recordings out")
        return one.astype(np.float64)


def _checked(
    wanted: Mapping[str, int | None], given: Mapping[str, Sequence[str]] | None, what: str
) -> Mapping[str, Sequence[str]]:
    """Whether the names given are of signals that there are, and as many as each has components."""
    for name, own in (given or {}).items():
        if name not in wanted:
            raise UserError(f"--signal {name}=...: the spec has no signal {name}{nearest(name, wanted)}")
        count = wanted[name] or 1
        if len(own) != count and (what == "columns" or len(own) != 1):
            raise UserError(
                f"--signal {name}={','.join(own)}: {len(own)} names; expected {count}, one for each component of "
                f"{name}; add or delete some"
            )
    return given or {}


def _period(name: str, times: Array, digit: float, places: Sequence[str]) -> float | None:
    """The time between two samples, s.

    Args:
      name: of the column or array.
      times: (T,), s.
      digit: to which they are rounded.
      places: of each time, for messages.
    """
    if len(times) < 2:
        return None
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
                f"{places[row + 1]}: time {problem}, from {times[row]:.12g} to {times[row + 1]:.12g} s, where "
                f"{usual:.6g} s are usual; expected even steps; repair the recording, or resample it"
            )
    mean = float(times[-1] - times[0]) / len(steps)
    rates = [round(1 / mean / unit) * unit for unit in (10, 5, 1)]
    round_ones = [1 / rate for rate in rates if rate] + [float(f"{mean:.{digits}g}") for digits in (1, 2, 3)]
    for candidate in round_ones:
        off = times - times[0] - candidate * np.arange(len(times))
        if np.abs(off).max() <= max(digit, JITTER * mean):
            return candidate
    return mean


def read_arrays(path: str | Path) -> Arrays:
    """Reads one trajectory from an NPZ file with one array per signal.

    Raises:
      UserError: if the file holds no arrays of numbers.
    """
    from zipfile import BadZipFile  # only for such files: the command should start fast

    try:
        with np.load(path, allow_pickle=False) as file:
            return Arrays(path, {name: file[name] for name in file.files})
    except OSError as error:
        raise UserError(f"{path}: the trace cannot be read: {error.strerror or error}; give an NPZ file") from None
    except (ValueError, BadZipFile, EOFError) as error:
        raise UserError(f"{path}: the trace is no NPZ file of numbers: {error}; save it with numpy.savez") from None


def read_recording(path: str | Path) -> Recording | Arrays:
    """Reads one trajectory from an NPZ file, or from a text with one row per sample and named columns.

    Commas separate columns. If semicolons or tabs do so in the header, numbers may have decimal commas. Empty lines and
    lines that begin with # are skipped, but the last such line before the numbers may be the header.

    Raises:
      UserError: if the file holds no table.
    """
    try:
        if Path(path).suffix.lower() == ".npz":
            return read_arrays(path)
        if Path(path).is_char_device():
            raise UserError(f"{path}: the trace is a device; expected a file; give the path of a CSV file")
        with open(path, newline="", encoding="utf-8-sig") as file:
            text = file.readlines()
            delimiter = _delimiter(text)
            lines = _rows(text, delimiter)
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
            if len(row) > len(first) and delimiter == ",":
                advice = "write decimal points, not commas" if row[-1].strip() else "delete the comma at its end"
            raise UserError(
                f"{path}:{line}:{min(len(row), len(first)) + 1}: the row has {_count(len(row))}; expected "
                f"{len(first)}, as the header; {advice}"
            )
    return Recording(path, top, [name.strip() for name in first], samples, delimiter != ",")


def _delimiter(lines: Sequence[str]) -> str:
    """The sign that separates columns, from the first line that is no comment, or from a header in a comment."""
    header = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    return next(
        (mark for mark in ("\t", ";") if mark in header and (mark == "\t" or "," not in header.split(mark)[0])), ","
    )


def _rows(file: Iterable[str], delimiter: str) -> list[tuple[int, list[str]]]:
    """The rows of a CSV text with their lines, without comments, the header first."""
    comment = ""
    lines: list[tuple[int, list[str]]] = []

    def without_comments() -> Iterator[str]:
        nonlocal comment
        for line in file:
            is_comment = line.lstrip().startswith("#")
            comment = line if is_comment and not lines else comment
            yield "\n" if is_comment else line

    reader = csv.reader(without_comments(), delimiter=delimiter)
    for row in filter(None, reader):
        if not lines and comment and all(map(_is_number, row)):  # as NumPy's savetxt writes it
            (names,) = csv.reader([comment.lstrip()[1:]], delimiter=delimiter)
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
