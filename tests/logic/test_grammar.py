"""The kept tables are those of the grammar, and every row of the table of advice is reached."""

from pathlib import Path

import pytest
from test_advice import CASES
from test_mistakes import cases, message

from tltlrl.logic import advice, grammar, parser, tables
from tltlrl.logic.errors import Source
from tltlrl.resources import SPECS

ROOT = Path(__file__).parents[2]


def test_the_tables_are_of_this_grammar():
    """`make grammar` writes them anew."""
    assert grammar.digest() == tables.DIGEST


def test_the_lark_that_is_pinned_reads_the_tables():
    assert f"lark=={tables.LARK}\n" in (ROOT / "constraints.txt").read_text(encoding="utf-8")


@pytest.fixture
def built(monkeypatch):
    """The parser from the grammar itself, as with another version of lark."""
    monkeypatch.setattr(tables, "LARK", "0")
    parser._parser.cache_clear()
    yield
    parser._parser.cache_clear()


def test_the_parser_of_the_grammar_reads_the_same(monkeypatch):
    texts = [path.read_text(encoding="utf-8") for path in SPECS.glob("*.tltl")]
    kept = [parser.parse(Source("<spec>", text)) for text in texts]
    monkeypatch.setattr(tables, "LARK", "0")
    parser._parser.cache_clear()
    assert kept == [parser.parse(Source("<spec>", text)) for text in texts]
    parser._parser.cache_clear()


@pytest.mark.usefixtures("built")
def test_the_parser_of_the_grammar_tells_the_same_mistakes():
    for title, spec, given in cases():
        assert message(spec, given) == given["message"].rstrip("\n"), title


def reached(text):
    """The row of the table that a spec's mistake leads to; None if it is not one of the parser's."""
    rows = []
    table = tuple(
        (condition, lambda stop, own=own, row=row: (rows.append(row), own(stop))[1])
        for row, (condition, own) in enumerate(advice.TABLE)
    )
    before, advice.TABLE = advice.TABLE, table
    try:
        message(text, {})
    finally:
        advice.TABLE = before
    return rows[0] if rows else None


# Specs that reach the rows which no case of mistakes.txt does, and a part of what they are told.
OTHERS = {
    ",": "expected a formula or a number before it",
    "x [": "expected a label or a number",
    "1 :": "delete it or close what was opened",
    "2 ,": "delete it or join the two parts with an operator",
}


@pytest.mark.parametrize(("spec", "told"), OTHERS.items())
def test_rare_mistakes_are_told(spec, told):
    assert told in message(spec, {})


def test_every_row_of_the_table_of_advice_is_reached():
    rows = {reached(spec) for spec in [*(spec for _, spec, _ in cases()), *(spec for spec, *_ in CASES), *OTHERS]} - {
        None
    }
    assert sorted(rows) == list(range(len(advice.TABLE)))
