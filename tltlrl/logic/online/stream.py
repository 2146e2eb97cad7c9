"""Reads samples from lines of text as they arrive: CSV with a header, or one JSON object per line."""

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping

from tltlrl.errors import UserError, nearest, printable
from tltlrl.logic.trace import columns

Sample = dict[str, float | list[float]]


def samples(lines: Iterable[str], wanted: Mapping[str, int | None], name: str) -> Iterator[Sample | UserError]:
    """Yields the sample of each line, or a UserError for a line without a valid sample.

    Empty lines and lines that begin with # are skipped. In JSON, a vector is a list, or has a key per component, as in
    CSV.

    Args:
      lines: lines of the text.
      wanted: signal => dimension of a vector, None for a scalar.
      name: name of the text, for messages.

    Raises:
      UserError: if the header has no column for a signal.
    """
    header: list[str] = []
    is_json, comment = False, ""
    for number, line in enumerate(lines, start=1):
        text = line.lstrip("\ufeff").strip()
        if text.startswith("#"):
            comment = text[1:]
        if not text or text.startswith("#"):
            continue
        place = f"{name}:{number}"
        is_json = is_json or (not header and text.startswith("{"))
        if is_json:
            yield _told(place, _fields_of_json(place, text), wanted)
            continue
        (cells,) = csv.reader([text])
        if not header:
            header = [cell.strip() for cell in cells]
            is_header = not all(map(_is_number, header))
            if not is_header and comment:  # as NumPy's savetxt writes it
                header = [cell.strip() for cell in next(csv.reader([comment]))]
            _check_header(place, header, wanted)
            if is_header:
                continue
        if len(cells) != len(header):
            yield UserError(f"{place}: the row has {len(cells)} cells; expected {len(header)}, as the header")
            continue
        yield _told(place, dict(zip(header, cells, strict=True)), wanted)


def _check_header(place: str, header: list[str], wanted: Mapping[str, int | None]) -> None:
    for signal, dimension in wanted.items():
        for i, column in enumerate(columns(signal, dimension)):
            if column not in header and f"{signal}[{i}]" not in header:
                raise UserError(f"{place}: there is no column {column}{nearest(column, header)}")


def _fields_of_json(place: str, text: str) -> Mapping[str, object] | UserError:
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        return UserError(f'{place}: the line is no JSON; expected an object such as {{"x": 0.5}}')
    if not isinstance(fields, dict):
        return UserError(f'{place}: the line holds no JSON object; expected one such as {{"x": 0.5}}')
    return fields


def _told(place: str, fields: Mapping[str, object] | UserError, wanted: Mapping[str, int | None]) -> Sample | UserError:
    """The sample in some fields, or what is wrong with it."""
    if isinstance(fields, UserError):
        return fields
    try:
        return {signal: _value(place, fields, signal, dimension) for signal, dimension in wanted.items()}
    except UserError as error:
        return error


def _value(place: str, fields: Mapping[str, object], signal: str, dimension: int | None) -> float | list[float]:
    if dimension is None:
        return _number(place, signal, _field(place, fields, signal, (signal,)))
    whole = fields.get(signal)
    if isinstance(whole, list):
        if len(whole) != dimension:
            raise UserError(f"{place}: {signal} has {len(whole)} numbers; expected {dimension}")
        return [_number(place, f"{signal}[{i}]", value) for i, value in enumerate(whole)]
    names = zip(columns(signal, dimension), (f"{signal}[{i}]" for i in range(dimension)), strict=True)
    return [_number(place, own[0], _field(place, fields, signal, own)) for own in names]


def _field(place: str, fields: Mapping[str, object], signal: str, names: tuple[str, ...]) -> object:
    for name in names:
        if name in fields:
            return fields[name]
    raise UserError(f"{place}: there is no {signal}{nearest(signal, fields)}")


def _number(place: str, name: str, given: object) -> float:
    truth = {"true": 1.0, "false": 0.0}.get(str(given).strip().lower())
    if truth is not None:
        return truth
    if not _is_number(given):
        raise UserError(f"{place}: {name} is '{printable(given)}'; expected a finite number")
    assert isinstance(given, str | int | float)
    return float(given)


def _is_number(given: object) -> bool:
    if isinstance(given, bool) or not isinstance(given, str | int | float):
        return False
    try:
        return "_" not in str(given) and math.isfinite(float(given))  # Python reads 1_000 as 1000
    except (ValueError, OverflowError):
        return False
