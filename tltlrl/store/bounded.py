"""JSON and YAML of others, bounded: in size, in depth, and in what YAML's aliases unfold to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

MOST_BYTES = 32 * 2**20
MOST_DEPTH = 64
MOST_NODES = 200_000  # of one YAML file, aliases unfolded


class BoundsError(ValueError):
    """A file that is larger or deeper than any of ours."""


def read_json(path: Path) -> Any:
    """What a JSON file says.

    Raises:
      OSError, ValueError: if it cannot be read, or is none, or is out of bounds.
    """
    try:
        return json.loads(_text(path))
    except RecursionError:
        raise BoundsError(f"{path.name} is nested too deeply") from None


def read_yaml(path: Path) -> Any:
    """What a YAML file says, in plain data.

    Raises:
      OSError, ValueError, yaml.YAMLError: if it cannot be read, or is none, or is out of bounds.
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
    """Whether a file that something else will read is within the bounds, if it is YAML at all.

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
    """Whether a YAML tree, aliases unfolded, is within the bounds.

    Raises:
      BoundsError: if it is not.
    """
    sizes: dict[int, int] = {}  # of every node, by its identity; 0 while its parts are counted

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
