"""The parser of grammar.lark, loaded from the tables in tables.py: building them takes longer than parsing.

After a change of grammar.lark, `make grammar` has to write tables.py again; a test fails until it has.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import lark
from lark import Lark, Token, Transformer

from tltlrl.logic import tables

GRAMMAR = Path(__file__).with_name("grammar.lark")
OPTIONS: dict[str, Any] = {"parser": "lalr", "lexer": "basic", "keep_all_tokens": True, "maybe_placeholders": False}


def parser(builder: Transformer[Token, object], words: Any = None) -> Lark:
    """The parser, from the tables; built from the grammar if the tables are of another version of lark.

    Args:
      builder: its methods make the syntax tree, one per rule.
      words: processes the tokens of a text before they are parsed (lark's postlex).
    """
    if lark.__version__ == tables.LARK:
        kept: Lark = Lark._load_from_dict(tables.DATA, tables.MEMO, transformer=builder, postlex=words)  # type: ignore[no-untyped-call]
        return kept
    return built(builder, words)


def built(builder: Transformer[Token, object] | None = None, words: Any = None) -> Lark:
    """The parser, built from the grammar itself."""
    return Lark(GRAMMAR.read_text(encoding="utf-8"), transformer=builder, postlex=words, **OPTIONS)


def digest() -> str:
    """SHA-256 of the grammar, which shows whether the tables belong to it."""
    return hashlib.sha256(GRAMMAR.read_bytes()).hexdigest()


def write_tables() -> None:
    """Writes tables.py as plain literals, so that nothing has to be unpickled."""
    from lark.grammar import Rule
    from lark.lexer import TerminalDef

    data, memo = built().memo_serialize([TerminalDef, Rule])
    GRAMMAR.with_name("tables.py").write_text(
        '"""Tables of grammar.lark; written by `make grammar`, not by hand."""\n\n'
        "from typing import Any\n\n"
        f'LARK = "{lark.__version__}"\nDIGEST = "{digest()}"\n'
        f"DATA: dict[str, Any] = {data!r}\nMEMO: dict[int, Any] = {memo!r}\n",
        encoding="utf-8",
    )
