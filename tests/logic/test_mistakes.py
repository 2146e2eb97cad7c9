"""Every message about a wrong spec or a wrong trace, in full.

mistakes.txt holds the cases: a spec, optionally constants that override its own, signals or lengths, and the message.
`python tests/logic/test_mistakes.py` writes the messages anew; read the difference before committing it.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tltlrl.logic import SpecError, TraceError, load_spec, parse_spec

FILE = Path(__file__).with_name("mistakes.txt")


def cases():
    for block in re.split(r"^=== ", FILE.read_text(encoding="utf-8"), flags=re.M)[1:]:
        title, rest = block.split("\n", 1)
        spec, *parts = re.split(r"^--- ", rest, flags=re.M)
        given = dict(part.split("\n", 1) for part in parts)
        yield title, spec, given


def message(spec, given):
    data = {key: json.loads(given[key]) for key in ("constants", "signals", "lengths") if key in given}
    try:
        ready = parse_spec(spec.rstrip("\n"), data.get("constants"))
        if "signals" in data:
            ready.robustness(data["signals"], data.get("lengths"))
    except (SpecError, TraceError) as error:
        expected = TraceError if "signals" in data else SpecError
        return str(error) if type(error) is expected else f"a {type(error).__name__}"
    return "no mistake was found"


@pytest.mark.parametrize(("title", "spec", "given"), [pytest.param(*case, id=case[0]) for case in cases()])
def test_message(title, spec, given):
    found = message(spec, given)
    assert found == given["message"].rstrip("\n"), title
    place, line, caret = found.split("\n")
    assert re.match(r"<spec>:\d+:\d+: .+; .+; .+", place), "what was found; what was expected; what to do"
    assert line.index("|") == caret.index("|")


def test_there_are_many():
    assert len({given["message"] for _, _, given in cases()}) > 100


def test_a_file_of_another_encoding(tmp_path):
    path = tmp_path / "task.tltl"
    path.write_bytes(b"# caf\xe9\nx < 1")
    with pytest.raises(SpecError, match=r"task.tltl:1:1: the file is not UTF-8"):
        load_spec(path)


HUGE = 10**5000


@pytest.mark.parametrize(
    ("signals", "lengths", "told"),
    [
        ({"x": [[HUGE]]}, None, "no array of numbers"),
        ({"x": [[1 + 2j]]}, None, "no array of numbers"),
        ({"x": np.array([["2026-01-01"]], dtype="datetime64[D]")}, None, "no array of numbers"),
        ({"x": np.array([[1]], dtype="timedelta64[s]")}, None, "no array of numbers"),
        ({"x": np.ma.masked_greater([[1.0, 9.0]], 5)}, None, "holds masked numbers"),
        ({"x": [np.ma.masked_greater([1.0, 9.0], 5)]}, None, "holds masked numbers"),
        ({0: [[1.0]]}, None, "there are: 0"),
        ({"x": np.empty((0, 3))}, [2], r"lengths has shape \(1,\)"),
    ],
)
def test_signals_and_lengths_that_only_python_can_pass(signals, lengths, told):
    with pytest.raises(TraceError, match=told):
        parse_spec("G x < 1").robustness(signals, lengths)


def test_what_looks_like_floats_is_read():
    spec = parse_spec("G x < 1")
    for given in (np.array([[0, -1]], dtype=object), np.array([[False]]), np.ma.array([[0.0]]), np.float32([[0]])):
        assert spec.robustness({"x": given}) == [1]
    assert spec.robustness({"x": np.empty((0, 3))}, []).shape == (0,)


@pytest.mark.parametrize("given", [{"c": HUGE}, {"c": np.True_}, {"c": {1}}, {1: 2}, 5])
def test_constants_that_only_python_can_pass(given):
    with pytest.raises(SpecError, match=r"<spec>:1:7: .*override"):
        parse_spec("const c = 1\nsignal x\nspec: x < c", given)
    with pytest.raises(SpecError, match=r"<spec>:1:7: .*override"):
        parse_spec("const c = (1, 2)\nsignal x\nspec: x < c.x", given)


@pytest.mark.parametrize("text", [None, b"x < 1"])
def test_what_is_no_text(text):
    with pytest.raises(TypeError, match="a spec's text is a str, not"):
        parse_spec(text)


@pytest.mark.parametrize("text", ["signal x[{}]\nspec: x < 1", "signal x[2]\nspec: x[{}] < 1", "G[0,{}] x < 1"])
def test_numbers_of_thousands_of_digits(text):
    with pytest.raises(SpecError):
        parse_spec(text.format("9" * 5000))


def test_errors_travel_between_processes():
    import pickle

    with pytest.raises(SpecError) as found:
        parse_spec("x <")
    again = pickle.loads(pickle.dumps(found.value))
    assert str(again) == str(found.value)
    assert isinstance(again, ValueError)


if __name__ == "__main__":
    blocks = []
    for title, spec, given in cases():
        given["message"] = message(spec, given) + "\n"
        blocks.append(f"=== {title}\n{spec}" + "".join(f"--- {key}\n{value}" for key, value in given.items()))
    FILE.write_text("".join(blocks), encoding="utf-8")
