"""What docs/online.md says."""

import io
import re
from pathlib import Path

import numpy as np
import pytest

from tltlrl.cli import main as cli
from tltlrl.logic import parse_spec

PAGE = (Path(__file__).parents[3] / "docs" / "online.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("code", re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL))
def test_the_pages_code_does_what_it_says(code):
    exec(code, {})


EQUATIONS = [
    equation.strip()
    for line in re.findall(r"^    (?=[GF] p)(.*)$", PAGE, flags=re.MULTILINE)
    for equation in re.split(r" {3,}", line)
]


@pytest.mark.parametrize("equation", EQUATIONS)
def test_what_a_formula_asks_of_now_and_of_the_next_sample(equation):
    """The left side is the formula up to the first =; b is 3."""
    signals = {name: np.random.default_rng(0).normal(size=(50, 7)) for name in "xy"}
    sides = [re.sub(r"b(-1)?\]", lambda b: f"{2 if b[1] else 3}]", side) for side in equation.split(" = ")]
    one, two = (
        parse_spec(f"signal x\nsignal y\ndef p: x > 0\ndef q: y > 0\nspec: {side}").robustness(signals)
        for side in sides
    )
    assert len(EQUATIONS) == 6
    np.testing.assert_array_equal(one, two)


def test_a_robot_is_watched(tmp_path, monkeypatch, capsys):
    (command,) = re.findall(r"^    robot \| tltl (.*)$", PAGE, flags=re.MULTILINE)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my_task.tltl").write_text("signal x\nspec: F (x > 1)")
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"x\n0\n3\n")))
    with pytest.raises(SystemExit) as ended:
        cli.main(command.split())
    assert ended.value.code == 0
    *samples, verdict = capsys.readouterr().out.splitlines()
    assert [line.split()[:3] for line in samples] == [["0", "robustness", "-1"], ["1", "robustness", "+2"]]
    assert verdict.startswith("satisfied, robustness +2")
