"""Recorded trajectories: from a CSV file to the signals of a spec."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest, printable

Array = NDArray[np.float64]


def columns(name: str, dimension: int | None) -> list[str]:
    """The names of a signal's columns in a trace."""
    if dimension is None:
        return [name]
    return [f"{name}.{'xyz'[i]}" if dimension <= 3 else f"{name}[{i}]" for i in range(dimension)]


def read_trace(path: str | Path, signals: Mapping[str, int | None]) -> dict[str, Array]:
    """One trajectory's signals, from a CSV file with one row per sample and named columns; # begins a comment line.

    Args:
      path: of the file.
      signals: name => dimension of a vector, None for a scalar.

    Returns:
      name => (1, T) for a scalar, (1, T, d) for a vector.

    Raises:
      UserError: with the line and column of what has to be mended.
    """
    (top, header), samples = _cells(path)

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


def _cells(path: str | Path) -> tuple[tuple[int, list[str]], list[tuple[int, list[str]]]]:
    """The header and the rows of a CSV file, each with its line; empty lines and lines that begin with # are left out.

    The header may be such a line, the last one before the numbers.

    Raises:
      UserError: if it holds no table.
    """
    try:
        if Path(path).is_char_device():
            raise UserError(f"{path}: the trace is a device; expected a file; give the path of a CSV file")
        with open(path, newline="", encoding="utf-8-sig") as file:
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
            advice = "complete it or delete it"
            if len(row) > len(header):
                advice = "write decimal points, not commas" if row[-1].strip() else "delete the comma at its end"
            raise UserError(
                f"{path}:{line}:{min(len(row), len(header)) + 1}: the row has {_count(len(row))}; expected "
                f"{len(header)}, as the header; {advice}"
            )
    return (top, header), samples


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _count(cells: int) -> str:
    return "1 cell" if cells == 1 else f"{cells} cells"


def _number(place: str, name: str, cell: str) -> float:
    try:
        number = math.nan if "_" in cell else float(cell)  # Python reads 1_000 as 1000
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        shown = f"'{printable(cell)}'"
        raise UserError(f"{place}: {name} is {shown}; expected a finite number; repair the recording") from None
    return number
