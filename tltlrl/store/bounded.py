"""Reads JSON and YAML files from others within bounds of size and depth, with YAML's aliases unfolded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

MOST_BYTES = 32 * 2**20
MOST_DEPTH = 64
MOST_NODES = 200_000  # in one YAML file, aliases unfolded


class BoundsError(ValueError):
    """A file is larger or deeper than any that tltlrl writes."""


def read_json(path: Path) -> Any:
    """The content of a JSON file.

    Raises:
      OSError, ValueError: if the file cannot be read, is not JSON, or is out of bounds.
    """
    try:
        return json.loads(_text(path))
    except RecursionError:
        raise BoundsError(f"{path.name} is nested too deeply") from None


def read_yaml(path: Path) -> Any:
    """The content of a YAML file, as plain data.

    Raises:
      OSError, ValueError, yaml.YAMLError: if the file cannot be read, is not YAML, or is out of bounds.
    """
    loader = yaml.SafeLoader(_text(path))
    try:
        node = loader.get_single_node()
        check_node(node)
        return None if node is None else loader.construct_document(node)
    except RecursionError:
        raise BoundsError("it is nested too deeply") from None
    finally:
        loader.dispose()


def check_yaml(path: Path) -> None:
    """Checks that a YAML file is within the bounds, before another library reads it; ignores a file that is not YAML.

    Raises:
      BoundsError: if it is not.
    """
    try:
        check_node(yaml.compose(_text(path), Loader=yaml.SafeLoader))
    except RecursionError:
        raise BoundsError("it is nested too deeply") from None
    except BoundsError:
        raise
    except (OSError, ValueError, yaml.YAMLError):
        return


def check_node(node: yaml.Node | None) -> None:
    """Checks that a YAML tree, aliases unfolded, is within the bounds.

    Raises:
      BoundsError: if it is not.
    """
    sizes: dict[int, int] = {}  # id of a node => its size; 0 while its parts are counted

    def size(part: yaml.Node, depth: int) -> int:
        if depth > MOST_DEPTH:
            raise BoundsError(f"it is nested more than {MOST_DEPTH} levels deep")
        if id(part) not in sizes:
            sizes[id(part)] = 0
            inner = part.value if isinstance(part, yaml.SequenceNode) else ()
            if isinstance(part, yaml.MappingNode):
                inner = [node for pair in part.value for node in pair]
            sizes[id(part)] = 1 + sum(size(node, depth + 1) for node in inner)
        if not sizes[id(part)]:
            raise BoundsError("an alias stands within what it names")
        if sizes[id(part)] > MOST_NODES:
            raise BoundsError(f"it holds more than {MOST_NODES} values, its aliases unfolded")
        return sizes[id(part)]

    if node is not None:
        size(node, 1)


def _text(path: Path) -> str:
    if path.stat().st_size > MOST_BYTES:
        raise BoundsError(f"{path.name} is larger than {MOST_BYTES // 2**20} MB")
    return path.read_text(encoding="utf-8")
