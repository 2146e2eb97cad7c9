"""The pages of the language say what is so: their code runs, the table's spellings and strengths are the parser's."""

import contextlib
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tltlrl.logic import SpecError, parse_spec
from tltlrl.logic.declarations import RESERVED

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "spec-language.md").read_text(encoding="utf-8")
CASE_STUDY = (ROOT / "docs" / "spec-case-study.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE + CASE_STUDY, flags=re.M | re.S)


@pytest.mark.parametrize("code", [code for kind, code in BLOCKS if kind == "python"])
def test_python(code):
    exec(code, {})


@pytest.mark.parametrize("code", [code for kind, code in BLOCKS if kind == "tltl"])
def test_specs(code):
    assert parse_spec(code)


@pytest.mark.parametrize("path", sorted((ROOT / "specs").glob("*.tltl")), ids=lambda path: path.stem)
def test_the_specs_are_the_files(path):
    assert ("tltl", path.read_text(encoding="utf-8")) in BLOCKS


def test_the_message():
    (shown,) = (code for kind, code in BLOCKS if kind == "text")
    text = "signal x\ndef at_goal: x < 1\ndef safe: x > 0" + "\n" * 12 + "spec: F G at_gaol & G safe"
    with pytest.raises(SpecError) as found:
        parse_spec(text, name="task.tltl")
    assert str(found.value) == shown.rstrip("\n")


ROWS = [
    [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in PAGE.split("## Operators")[1].split("## The end")[0].split("\n")
    if line.startswith("| `")
]


OPERATOR = re.compile(r"<=>|=>|(?:all|any)(?= )|X\[!\]|previous(?:\[!\])?|xor|[<>!&|GFXURWT]")


@pytest.mark.parametrize("row", [row for row in ROWS if re.search(r"\bp\b", row[0])])
def test_other_spellings(row):
    for form in re.findall(r"`(.*?)`", row[0]):
        for other in re.findall(r"`(.*?)`", row[1]):
            one, two = (
                parse_spec(re.sub(r"\b([pq])\b", r"(\1 < 1)", text).replace("[a,b]", "[1, 2]"))
                for text in (form, OPERATOR.sub(f"{other} ", form, count=1))
            )
            assert one == two


@pytest.mark.parametrize("row", [row for row in ROWS if not re.search(r"\bp\b", row[0])])
def test_other_spellings_of_arithmetic_and_comparisons(row):
    """Each means what one of the row's forms means."""

    def value(text):
        formula = text if re.search("[<>≤≥]", text) else f"{text} < 1"
        return float(parse_spec(formula).robustness({"a": [[3.0]], "b": [[2.0]]})[0])

    forms = re.findall(r"`(.*?)`", row[0])
    for other in re.findall(r"`(.*?)`", row[1]):
        others = {value(re.sub(r"\*\*|[-+*/<>]", other, form, count=1)) for form in forms}
        assert others & {value(form) for form in forms}


BINARY = ["<=>", "=>", "xor", "|", "&", "U"]


def test_strength_of_formulas():
    """Each binary operator of the table binds tighter than the one below it."""
    order = [f for row in ROWS for f in re.findall(r"`p (<=>|=>|xor|\||&|U) q`", row[0])]
    assert order == BINARY[::-1]
    for tight, loose in pairwise(order):
        plain = parse_spec(f"a < 1 {loose} b < 1 {tight} c < 1")
        assert plain == parse_spec(f"a < 1 {loose} (b < 1 {tight} c < 1)")
        assert parse_spec(f"a < 1 {tight} b < 1 {loose} c < 1") == parse_spec(f"(a < 1 {tight} b < 1) {loose} c < 1")


def test_words_that_cannot_be_names():
    words = re.search(r"cannot be names: `(.*?)` `(.*?)`", PAGE)
    for word in [*f"{words[1]} {words[2]}".split(), *RESERVED]:
        with pytest.raises(SpecError):
            parse_spec(f"signal {word}\nspec: {word} < 1")


ELSEWHERE = [
    [re.findall(r"`(.*?)`", cell)[0] for cell in line.split(" | ")[1:]]
    for line in PAGE.split("## From other tools")[1].split("\n## ")[0].split("\n")
    if "`" in line
]


@pytest.mark.parametrize(("there", "here"), ELSEWHERE)
def test_from_other_tools(there, here):
    """What is read as it is there has the value of what is to be written here; anything else is refused."""
    generator = np.random.default_rng(0)
    signals = {name: generator.uniform(0, 2, (20, 12)) for name in "xy"}
    expected = parse_spec(here).robustness(signals).tolist()
    try:
        spec = parse_spec(there)
    except SpecError:
        return
    assert spec.robustness(signals).tolist() == expected


def test_most_formulas_of_rtamt_and_spot_are_read_as_they_are():
    def is_read(text):
        with contextlib.suppress(SpecError):
            return bool(parse_spec(text))
        return False

    assert sum(is_read(there) for there, _ in ELSEWHERE) >= 10


SAID = [
    ("G F[0, 2?] x > 0", [1, -1, -1, 1, -1, -1], 1),
    ("G F[0, 2?] x > 0", [1, -1, -2, -1, -1, 1], -1),
    ("G (x > 0 => F[0, 2?] y > 0)", [-1, -1, -1, -1, -1, 1], 1),
    ("F G[0, 2!] x > 0", [-1, -1, -1, -1, 1, 1], -1),
    ("F G[0, 2!] x > 0", [-1, 1, 1, 1, -1, -1], 1),
    ("F (G x > 0 & G[0, 2!] x > 0)", [-1, 1, 1, 1, -1, -1], -1),
    ("F (G x > 0 & G[0, 2!] x > 0)", [-1, -1, -1, 1, 1, 1], 1),
]


@pytest.mark.parametrize(("formula", "x", "sign"), SAID)
def test_what_is_said_of_the_end(formula, x, sign):
    assert np.sign(parse_spec(formula).robustness({"x": [x], "y": [[-1] * 6]})) == sign


@pytest.mark.parametrize(
    ("formula", "value"),
    [("G[5,9] x < 1", float("inf")), ("F[5,9] x < 1", -float("inf")), ("X X X X X x < 1", float("inf"))],
)
def test_end_of_trace(formula, value):
    assert parse_spec(formula).robustness({"x": [[0.0] * 5]}) == [value]
