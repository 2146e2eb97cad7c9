"""docs/spec-examples.md: each spec is satisfied by its first trace and not by its second, as the command says."""

import re
from pathlib import Path

import pytest

from tltlrl.cli.check import check
from tltlrl.logic import parse_spec

PAGE = (Path(__file__).parents[2] / "docs" / "spec-examples.md").read_text(encoding="utf-8")
EXAMPLES = [
    (title, re.findall(r"^```(?:tltl|csv)\n(.*?)^```", text, flags=re.M | re.S))
    for title, text in re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, flags=re.M | re.S)
]


def test_there_are_twelve():
    assert [title.split(".")[0] for title, _ in EXAMPLES] == [str(i + 1) for i in range(12)]


@pytest.mark.parametrize("blocks", [pytest.param(blocks, id=title) for title, blocks in EXAMPLES])
def test_example(blocks, tmp_path, capsys):
    spec, *traces = blocks
    assert parse_spec(str(parse_spec(spec))) == parse_spec(spec)
    (tmp_path / "task.tltl").write_text(spec)
    assert len(traces) == 2
    for code, trace in enumerate(traces):
        (tmp_path / "trace.csv").write_text(trace)
        assert check(tmp_path / "task.tltl", tmp_path / "trace.csv") == code
        out = capsys.readouterr().out
        assert f"verdict      {'violated' if code else 'satisfied'}\n" in out
