"""`tltl watch`, through its parser and its function."""

import io
import json
import sys
from pathlib import Path

import pytest

from tltlrl.cli.main import main
from tltlrl.cli.watch import watch
from tltlrl.errors import UserError
from tltlrl.logic import SpecError

REACH_AVOID = Path(__file__).parents[2] / "specs" / "reach_avoid.tltl"
POINTS = [(1, 1.4), (-1, 1.4), (0.3, 2.1), (-1.2, 1.4)]
ANSWERS = f"""\
     0  robustness           -2  bounds         -inf    +0.421954  open     at step 0 by d_g < goal_radius in at_goal, margin -2
     1  robustness       +0.075  bounds         -inf    +0.421954  open     at step 1 by d_g < goal_radius in at_goal, margin +0.075
     2  robustness     -1.45529  bounds         -inf         -0.4  open     at step 2 by d_g < goal_radius in at_goal, margin -1.45529
     3  robustness         -0.4  bounds         -inf         -0.4  open     at step 2 by d_o[1] > obstacle_radius[1] in safe, margin -0.4
violated, robustness -0.4: decided at step 2 by d_o[1] > obstacle_radius[1] in safe, margin -0.4 ({REACH_AVOID}:16:26)
"""  # noqa: E501
POINTS[1] = (-1.075, 1.4)


@pytest.fixture
def spec(tmp_path):
    def write(text):
        path = tmp_path / "task.tltl"
        path.write_text(text, encoding="utf-8")
        return path

    return write


CSV = "t,ee.x,ee.y\n" + "".join(f"{t},{x},{y}\n" for t, (x, y) in enumerate(POINTS))


@pytest.mark.parametrize(
    "text",
    [
        CSV,
        CSV.replace("ee.x,ee.y", "ee[0],ee[1]").replace("\n", "\r\n"),
        "\ufeff# recorded\n\n" + CSV,
        "# " + CSV,
        "".join(json.dumps({"ee": p, "more": "text"}) + "\n" for p in POINTS),
        "".join(json.dumps({"ee.x": x, "ee.y": str(y)}) + "\n" for x, y in POINTS),
    ],
    ids=["csv", "crlf", "comments", "savetxt", "json", "json_components"],
)
def test_each_sample_is_answered_and_the_whole_judged(text, capsys):
    assert watch(REACH_AVOID, io.StringIO(text)) == 1
    assert capsys.readouterr() == (ANSWERS, "")


def test_a_sample_is_answered_before_the_next_one_comes(spec):
    out = io.StringIO()

    def lines():
        yield "x\n"
        for count in range(1, 4):
            yield "1\n"
            assert out.getvalue().count("\n") == count

    assert watch(spec("G (x > 0)"), lines(), out=out) == 0
    assert out.getvalue().endswith(
        f"satisfied, robustness +1: decided at step 0 by x > 0, margin +1 ({spec('G (x > 0)')}:1:4)\n"
    )


def test_a_line_that_is_no_sample_is_told_once_and_left_out(spec, capsys):
    text = "x,y\n1,1\nabc,1\n2\n1_0,1\nnan,1\n0,1\n3,0\n2,1\n"
    assert watch(spec("G (y / x > 0)"), io.StringIO(text)) == 1
    out, err = capsys.readouterr()
    assert err.splitlines() == [
        "tltl watch: <stdin>:3: x is 'abc'; expected a finite number; left out",
        "tltl watch: <stdin>:4: the row has 1 cells; expected 2, as the header; left out",
        "tltl watch: <stdin>:5: x is '1_0'; expected a finite number; left out",
        "tltl watch: <stdin>:6: x is 'nan'; expected a finite number; left out",
        *[line for line in err.splitlines() if "division by zero" in line or line.startswith("  ")],
    ]
    assert "'y / x' has no finite value at trajectory 0, step 1: division by zero" in err
    assert [line.split()[0] for line in out.splitlines()] == ["0", "1", "2", "undecided,"]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ('{"x": 1', "the line is no JSON"),
        ("[1]", "the line holds no JSON object"),
        ('{"ee": [1]}', "ee has 1 numbers; expected 2"),
        ('{"ee": [1, null]}', "ee[1] is 'None'; expected a finite number"),
        ('{"ea": [1, 2]}', "there is no ee; there are: ea"),
        ('{"ee": [1, 1e999]}', "ee[1] is 'inf'"),
    ],
)
def test_a_line_of_json_that_is_no_sample(line, problem, spec, capsys):
    text = '{"ee": [1, 2]}\n' + line + "\n"
    assert watch(spec("signal ee[2]\nspec: G (ee.x > 0)"), io.StringIO(text)) == 0
    assert f"tltl watch: <stdin>:2: {problem}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "<stdin>: there are no samples; expected one per line"),
        ("x\n", "<stdin>: there are no samples"),
        ("y,z\n1,2\n", "<stdin>:1: there is no column x; there are: y, z"),
        ("x\nabc\n", "<stdin>: there are no samples"),
    ],
)
def test_without_a_sample_there_is_no_verdict(text, problem, spec):
    with pytest.raises(UserError, match=problem):
        watch(spec("G (x > 0)"), io.StringIO(text), out=io.StringIO())


def test_bounds_in_seconds_need_a_period(spec):
    path, out = spec("F[0 s, 1 s] (x > 0)"), io.StringIO()
    with pytest.raises(SpecError, match="how far apart samples are is not known"):
        watch(path, io.StringIO("x\n1\n"))
    assert watch(path, io.StringIO("x\n-1\n-1\n-1\n"), period=0.5, out=out) == 1
    assert [line.split()[6] for line in out.getvalue().splitlines()[:3]] == ["open", "open", "decided"]
    with pytest.raises(UserError, match="--period -1: expected a positive number"):
        watch(path, io.StringIO("x\n1\n"), period=-1.0)


def test_true_and_false_are_read(spec, capsys):
    path = spec("signal on: bool\nspec: F on")
    for text in ("on\nfalse\nTrue\n", '{"on": false}\n{"on": true}\n'):
        assert watch(path, io.StringIO(text)) == 0
    assert "satisfied, robustness +inf: decided at step 1 by on" in capsys.readouterr().out


def test_who_read_the_output_may_go_away(spec, monkeypatch):
    class Closed(io.StringIO):
        def write(self, _):
            raise BrokenPipeError

        def fileno(self):
            return 1

    monkeypatch.setattr(sys, "stdin", io.StringIO("x\n1\n"))
    monkeypatch.setattr("os.dup2", lambda *_: None)
    monkeypatch.setattr(sys, "stdout", Closed())
    with pytest.raises(SystemExit) as end:
        main(["watch", str(spec("G (x > 0)"))])
    assert end.value.code == 0


def test_ctrl_c_ends_the_trajectory(spec, capsys):
    def lines():
        yield from ["x\n", "-1\n"]
        raise KeyboardInterrupt

    assert watch(spec("G (x > 0)"), lines()) == 1
    assert "violated, robustness -1" in capsys.readouterr().out
