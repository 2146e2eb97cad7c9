"""Reads a robot's page: YAML, with the line of every key, so that messages can name it."""

from __future__ import annotations

import dataclasses
import keyword
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from tltlrl.errors import UserError, nearest, printable
from tltlrl.store.bounded import BoundsError, check_node
from tltlrl.tasks.mjcf.keys import (
    ACTUATORS,
    COMMON,
    FEEDBACK,
    KINDS,
    MOTION,
    NAMES,
    NUMBER,
    SETTINGS,
    SIGNALS,
    RobotConfig,
)
from tltlrl.tasks.mjcf.keys import NUMBERS_BY_NAME as BY_NAME

Key = tuple[str, ...]  # ("signals", "tip")


class _Loader(yaml.SafeLoader):
    """A YAML loader that reads 1e-3 as a number."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+$"), list("-+0123456789")
)


@dataclass(frozen=True)
class Page:
    """The content of a page.

    Attributes:
      path: path of the file.
      values: its values as plain data.
      lines: keys that lead to a value => its line.
    """

    path: Path
    values: Mapping[str, Any]
    lines: Mapping[Key, int]

    def mistake(self, key: Key, what: str) -> UserError:
        """The error `file:line: key: what`. A key that is not on the page has the line of the nearest key above."""
        above = next((key[:n] for n in range(len(key), 0, -1) if key[:n] in self.lines), ())
        return UserError(f"{shown(self.path)}:{self.lines.get(above, 1)}: {'.'.join(key)}: {what}")


def shown(path: Path) -> str:
    """A path for messages: relative to the current folder if it lies in it."""
    relative = os.path.relpath(path)
    return str(path) if relative.startswith("..") else relative


def task_name(file: Path) -> str:
    """The name of a robot's task: the name of its page, as one word."""
    word = "".join(c if c.isalnum() or c == "_" else "_" for c in file.stem)
    return word if word.isidentifier() and not keyword.iskeyword(word) else f"robot_{word}"


def read_page(path: Path) -> Page:
    """Reads a page and checks its keys and what kinds of values they have.

    Raises:
      UserError: naming file, line and key.
    """
    try:
        return page_of(path, path.read_bytes())
    except OSError as error:
        raise UserError(f"{shown(path)}: the page cannot be read: {error.strerror}; give a robot's file") from None


def page_of(path: Path, data: bytes) -> Page:
    """Reads a page from the content of its file.

    Raises:
      UserError: naming file, line and key.
    """
    name = shown(path)
    try:
        node = yaml.compose(data.decode("utf-8-sig"), Loader=_Loader)
        check_node(node)
    except (BoundsError, RecursionError) as error:
        why = error if isinstance(error, BoundsError) else "it is nested too deeply"
        raise UserError(f"{name}: {why}; write the page of one robot, without aliases that repeat others") from None
    except UnicodeDecodeError:
        raise UserError(f"{name}: it is not text in UTF-8; save it as UTF-8") from None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise UserError(f"{name}:{line}: it is not YAML: {error.problem}; write key: value, one a line") from None
    except yaml.YAMLError as error:  # a control character
        raise UserError(f"{name}: it is not YAML: {str(error).splitlines()[0]}; save it as plain text") from None
    if not isinstance(node, yaml.MappingNode):
        raise UserError(f"{name}:1: expected the page of a robot; begin it with model: FILE.xml (see tltl new)")
    lines: dict[Key, int] = {}
    values = _plain(node, (), lines, name)
    page = Page(path, values, lines)
    check_values(values, page.mistake)
    if "model" not in values:
        raise UserError(f"{name}:1: model: it is missing; add model: FILE.xml, an MJCF file from the page's folder")
    return page


def _plain(node: yaml.Node, key: Key, lines: dict[Key, int], name: str) -> Any:
    """A node as plain data; records the line of every key."""
    if isinstance(node, yaml.SequenceNode):
        return [_plain(part, (*key, str(i)), lines, name) for i, part in enumerate(node.value)]
    if not isinstance(node, yaml.MappingNode):
        return yaml.constructor.SafeConstructor().construct_object(node, deep=True)
    values = {}
    for key_node, value_node in node.value:
        word, line = str(key_node.value), key_node.start_mark.line + 1
        inner = (*key, word)
        if inner in lines:
            raise UserError(f"{name}:{line}: {'.'.join(inner)}: it is there before, in line {lines[inner]}; delete one")
        lines[inner] = line
        values[word] = _plain(value_node, inner, lines, name)
    return values


def check_values(values: Mapping[str, Any], mistake: Callable[[Key, str], UserError], within: Key = ()) -> None:
    """Checks that every key exists and has the right kind of value.

    Args:
      values: key of a page => value.
      mistake: the keys that lead to a value, and what is wrong with it => the error that is raised.
      within: the keys that lead to these values: ("evaluation",), or none.
    """
    for key, value in values.items():
        if key not in KINDS:
            raise mistake((*within, key), f"no such key{nearest(key, KINDS)}")
        kind = KINDS[key].kind
        for inner in _wrong(value, kind):
            at: Any = value
            for part in inner:
                at = at[int(part)] if isinstance(at, list) else at[part]
            expected = PARTS.get(kind, kind)
            raise mistake(
                (*within, key, *inner),
                f"expected {expected if inner else kind}, not {printable(repr(at))}; "
                f"for instance {key}: {KINDS[key].example}",
            )
        if within and key in COMMON:
            raise mistake(
                (*within, key), "it is the same in training and in evaluation: a policy belongs to it; leave it out"
            )
        if kind == SETTINGS:
            check_values(value, mistake, (*within, key))


def check_overrides(config: RobotConfig) -> None:
    """Checks the kinds of all values of a config: overrides may have changed those of the page.

    Raises:
      UserError: naming the config's key.
    """
    usual = RobotConfig()
    values = {key: getattr(config, key) for key in KINDS if getattr(config, key) != getattr(usual, key)}
    check_values(values, lambda key, what: UserError(f"task.{'.'.join(key)}: {what}"))


def _wrong(value: Any, kind: str) -> Iterator[Key]:
    """Yields the keys that lead to the first part of a value that is not of a kind; nothing if all is."""
    if kind == NUMBER:
        right = _number(value)
    elif kind == NAMES:
        right = isinstance(value, list) and all(isinstance(part, str) for part in value)
    elif kind in (*FITS, SETTINGS):
        right = isinstance(value, dict)
        if right and kind != SETTINGS:
            yield from ((name,) for name, part in value.items() if not FITS[kind](part))
    elif kind == MOTION:
        right = value == "hold" or (isinstance(value, list) and bool(value))
        if right and value != "hold":
            yield from (
                (str(i),)
                for i, part in enumerate(value)
                if not isinstance(part, dict) or not all(_number(number) for number in part.values())
            )
    else:
        right = isinstance(value, str) and bool(value.strip())
    if not right:
        yield ()


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _numbers(value: Any) -> bool:
    return _number(value) or (isinstance(value, list) and bool(value) and all(map(_number, value)))


def _quantities(value: Any) -> bool:
    parts = value if isinstance(value, list) else [value]
    return bool(parts) and all(isinstance(part, str) for part in parts)


def _fed_back(value: Any) -> bool:
    return _numbers(value) or _parts(value)


def _parts(value: Any) -> bool:
    return isinstance(value, dict) and bool(value) and all(map(_numbers, value.values()))


FITS: Mapping[str, Callable[[Any], bool]] = {
    BY_NAME: _numbers,
    FEEDBACK: _fed_back,
    ACTUATORS: _parts,
    SIGNALS: _quantities,
}
PARTS = {
    BY_NAME: "a number",
    FEEDBACK: "one number or two, or joints with theirs",
    ACTUATORS: "its kind with its gain, and its range, as {motor: 10, range: 1}",
    SIGNALS: "a quantity or a list of them, as site_xpos.tip",
}


def mistake(config: RobotConfig, key: Key, what: str, told_within: Key = ()) -> UserError:
    """The error for a wrong value of a config, at its line if the value is on the page, otherwise at the config's key.

    Args:
      config: the config as it is used.
      key: the keys that lead to the value.
      what: what is wrong, and what to do.
      told_within: the key on the page that these settings stand below: ("evaluation",), or nothing.
    """
    try:
        page = read_page(Path(config.file))
    except (UserError, ValueError):
        return UserError(f"task.{'.'.join((*told_within, *key))}: {what}")
    there = page.values
    for part in told_within:
        there = there.get(part, {})
    if key[0] in there:
        if dataclasses.asdict(config).get(key[0]) == there[key[0]]:
            return page.mistake((*told_within, *key), what)
        return UserError(f"task.{'.'.join(key)}: {what}")
    if told_within:
        return mistake(config, key, what)
    if dataclasses.asdict(config).get(key[0]) != dataclasses.asdict(RobotConfig()).get(key[0]):
        return UserError(f"task.{'.'.join(key)}: {what}")
    return page.mistake(key, what)


def names_of(parts: Sequence[str]) -> str:
    """Names for a message."""
    return ", ".join(map(printable, parts)) or "none"
