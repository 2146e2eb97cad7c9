"""Every message about a wrong spec or a wrong trace, in full.

mistakes.txt holds the cases: a spec, optionally constants that override its own, signals or lengths, and the message.
`python tests/spec/test_mistakes.py` writes the messages anew; read the difference before committing it.
"""

import json
import re
from pathlib import Path

import pytest

from tltlrl.spec import SpecError, TraceError, load_spec, parse_spec

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
