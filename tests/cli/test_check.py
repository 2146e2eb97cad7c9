"""`tltl check`, through its parser and its function."""

import argparse
import io
import re
from pathlib import Path

import numpy as np
import pytest

from tltlrl.cli.check import add_arguments, check, run
from tltlrl.cli.main import main
from tltlrl.errors import UserError
from tltlrl.logic import SpecError
from tltlrl.logic.trace import read_recording

SPECS = Path(__file__).parents[2] / "specs"


@pytest.fixture
def trace(tmp_path):
    """The end-effector goes straight from (1, 1.5) to the goal, between the obstacles, and overshoots a little."""

    def write(header="t,ee.x,ee.y", offset=0.0):
        path = tmp_path / "trace.csv"
        x = np.concatenate((np.linspace(1, -1.2, 40), np.full(20, -1.2 + offset)))
        y = np.concatenate((np.linspace(1.3, 1.4, 40), np.full(20, 1.4)))
        rows = [f"{t},{a},{b}" for t, (a, b) in enumerate(zip(x, y, strict=True))]
        path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
        return path

    return write


def tltl(*arguments):
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    return run(parser.parse_args(list(map(str, arguments))))


def test_without_a_trace(capsys):
    assert tltl(SPECS / "reach_avoid.tltl") == 0
    assert capsys.readouterr().out == (
        f"spec         {SPECS / 'reach_avoid.tltl'}\n"
        "formula      F G at_goal & G safe\n"
        "named        at_goal: d_g < goal_radius\n"
        "             safe: all i in 1, 2: d_o[i] > obstacle_radius[i]\n"
        "signals      ee, vector of 2: columns ee.x, ee.y\n"
        "constants    goal = (-1.2, 1.4)\n"
        "             goal_radius = 0.2\n"
        "             obstacle = {1: (0.3, 2), 2: (-0.6, 0.6)}\n"
        "             obstacle_radius = {1: 0.5, 2: 0.4}\n"
        "horizon      the whole trajectory\n"
        "warning      18:7: 'F G at_goal' is 'at_goal' at the last sample: nothing is asked of the others; to ask for "
        "n+1 samples write F G[0,n!] p, for once in any n+1 samples G F[0,n?] p\n"
    )


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        ("F[0,5] x < 1", "the formula looks at 6 samples and the trace ends after 2: windows are cut"),
        (
            "F x < 1 & F y < 20",
            "the margins of 'y < 20' reach 25 here, those of 'x < 1' 0.75: min and max compare",
        ),
        ("F x < 1 & F y < 2", ""),
        ("F x < 1 & holds(F y < 20)", ""),
    ],
)
def test_what_is_easily_missed_in_a_trace_is_told(formula, told, tmp_path, capsys):
    (tmp_path / "task.tltl").write_text(formula)
    (tmp_path / "trace.csv").write_text("x,y\n0.5,5\n0.25,-5\n")
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.csv") == 0
    out = capsys.readouterr().out
    assert told in out
    assert ("warning" in out) == bool(told)


@pytest.mark.parametrize("header", ["t,ee.x,ee.y", "t,ee[0],ee[1]", "time , ee.x , ee.y "])
def test_a_satisfied_trace(header, trace, capsys):
    assert tltl(SPECS / "reach_avoid.tltl", trace(header)) == 0
    out = capsys.readouterr().out
    assert "robustness   +0.167" in out
    assert "verdict      satisfied" in out
    assert "by d_o[1] > obstacle_radius[1] in safe, margin +0.167" in out


def test_a_violated_trace_is_a_result(trace, capsys):
    assert tltl(SPECS / "reach_avoid.tltl", trace(offset=0.25)) == 1
    out = capsys.readouterr().out
    assert "robustness   -0.05\n" in out
    assert "verdict      violated\n" in out
    assert "by d_g < goal_radius in at_goal, margin -0.05 (" in out
    assert "at step 0" in out


def test_the_number_beside_a_formula_is_its_value(tmp_path, capsys):
    (tmp_path / "light.tltl").write_text("G !(red > 0.5)")
    (tmp_path / "trace.csv").write_text("red\n0\n1\n")
    assert tltl(tmp_path / "light.tltl", tmp_path / "trace.csv") == 1
    out = capsys.readouterr().out
    assert "robustness   -0.5\n" in out
    assert "explanation  decided at step 1 by !(red > 0.5), margin -0.5 (" in out


def test_constants_are_set(trace, capsys):
    assert tltl(SPECS / "reach_avoid.tltl", trace(offset=0.25), "--set", "goal_radius=0.3") == 0
    assert tltl(SPECS / "visit_in_order.tltl", "--set", "goal.r=[1,2]", "--set", "goal.g=[3,4]") == 0
    assert "goal = {r: (1, 2), g: (3, 4), b: (1.6, 0.6)}" in capsys.readouterr().out
    with pytest.raises(UserError, match="not a number or a list"):
        tltl(SPECS / "reach_avoid.tltl", "--set", "goal_radius=wide")
    with pytest.raises(UserError, match="not a number or a list"):
        tltl(SPECS / "reach_avoid.tltl", "--set", "goal_radius=" + "9" * 5000)
    with pytest.raises(SpecError, match=r"give all of it at once, as goal=\[-1.2,1.4\]"):
        tltl(SPECS / "reach_avoid.tltl", "--set", "goal.0=1.6", "--set", "goal.1=1.4")
    for twice in (["goal_radius=1", "goal_radius=2"], ["obstacle.1=[1,2]", 'obstacle={"2":[0,0]}']):
        with pytest.raises(UserError, match="is set before; expected each once; delete one"):
            tltl(SPECS / "reach_avoid.tltl", "--set", twice[0], "--set", twice[1])
    with pytest.raises(SpecError, match="did you mean goal_radius"):
        tltl(SPECS / "reach_avoid.tltl", "--set", "goal_radus=1")


@pytest.mark.parametrize("name", ["picture.png", "picture.pdf"])
def test_a_picture(name, trace, tmp_path, capsys):
    assert tltl(SPECS / "reach_avoid.tltl", trace(), "--plot", tmp_path / name) == 0
    assert (tmp_path / name).stat().st_size > 5000
    assert f"picture      {tmp_path / name}" in capsys.readouterr().out
    for path in (tmp_path / "picture.doc", tmp_path / "picture", tmp_path / "picture.ps"):
        with pytest.raises(UserError, match=r"expected one of \.png, \.pdf, \.svg"):
            tltl(SPECS / "reach_avoid.tltl", trace(), "--plot", path)
    with pytest.raises(UserError, match=r"there is no folder .*none for the picture"):
        tltl(SPECS / "reach_avoid.tltl", trace(), "--plot", tmp_path / "none" / "picture.png")
    with pytest.raises(UserError, match="--plot draws a trace"):
        tltl(SPECS / "reach_avoid.tltl", "--plot", tmp_path / "a.png")


def test_names_that_begin_with_an_underscore_are_in_the_legend(tmp_path):
    (tmp_path / "task.tltl").write_text("F _x < 1")
    (tmp_path / "trace.csv").write_text("_x\n0.5\n2\n")
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.csv", "--plot", tmp_path / "picture.svg") == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"trace.csv:1:1: the file is empty; expected a row of column names"),
        ("x\n", r"trace.csv:2:1: there are no samples"),
        ("y\n1\n", r"trace.csv:1:1: there is no column x; there are: y"),
        ("x\n1\na\n", r"trace.csv:3:1: x is 'a'; expected a finite number"),
        ("y,x\n1,2\n1\n", r"trace.csv:3:2: the row has 1 cell; expected 2, as the header; complete it or delete it"),
        ("x\n0,5\n0,7\n", r"trace.csv:2:2: the row has 2 cells; expected 1, as the header; write decimal points"),
        ("x,y\n1,2,\n", r"trace.csv:2:3: the row has 3 cells; expected 2, as the header; delete the comma at its end"),
        ("# made today\nx\na\n", r"trace.csv:3:1: x is 'a'; expected a finite number"),
        ("# made today\n1\n2\n", r"trace.csv:1:1: there is no column x; there are: made today"),
        ("x\n" + 200 * "a" + "\n", r"trace.csv:2:1: x is 'a{80}\.\.\.'; expected a finite number"),
        ("\x1b[31my\n1\n", r"trace.csv:1:1: there is no column x; there are: \?\[31my$"),
        ("x,x\n1,2\n", r"trace.csv:1:2: there are 2 columns x; expected one; delete or rename the others"),
        ("x\n1_000\n", r"trace.csv:2:1: x is '1_000'; expected a finite number"),
        ("x\n1\nnan\n", r"trace.csv:3:1: x is 'nan'; expected a finite number; repair the recording"),
        ('note,x\n"two\nlines",1\n,-inf\n', r"trace.csv:4:2: x is '-inf'; expected a finite number"),
        ("\nx\n\na\n", r"trace.csv:4:1: x is 'a'; expected a finite number"),
        ("\n\ny\n1\n", r"trace.csv:3:1: there is no column x; there are: y"),
    ],
)
def test_a_wrong_trace(text, message, tmp_path):
    (tmp_path / "task.tltl").write_text("F G x < 1")
    (tmp_path / "trace.csv").write_text(text)
    with pytest.raises(UserError, match=message):
        check(tmp_path / "task.tltl", tmp_path / "trace.csv", out=io.StringIO())


def test_a_missing_column_among_many_is_told_briefly(tmp_path):
    (tmp_path / "task.tltl").write_text("F G x < 1")
    names = [f"column{i}" for i in range(200_000)]
    (tmp_path / "trace.csv").write_text(",".join(names) + "\n" + ",".join("0" for _ in names) + "\n")
    with pytest.raises(UserError, match="there is no column x; there are: column0, column1, ") as found:
        check(tmp_path / "task.tltl", tmp_path / "trace.csv", out=io.StringIO())
    assert len(str(found.value)) < 1000


@pytest.mark.parametrize(
    "text",
    [
        "t,x\n0,0.5\n1,0.75\n",
        '# made today\nt,x\n# a remark, with "a quote\n0,0.5\n  # another\n1,0.75\n',
        "# t,x\n0,0.5\n1,0.75\n",  # as NumPy's savetxt writes it
        "#t,x\n0,0.5\n1,0.75\n",
    ],
)
def test_comments_in_a_trace(text, tmp_path):
    (tmp_path / "trace.csv").write_text(text)
    assert read_recording(tmp_path / "trace.csv").signals({"x": None})["x"].tolist() == [[0.5, 0.75]]


@pytest.mark.parametrize("cells", ["True,False,False", "true, false, FALSE", "1,0,0", "1.0,0.0,0"])
def test_cells_of_true_and_false(cells, tmp_path, capsys):
    (tmp_path / "task.tltl").write_text("signal pressed: bool\nsignal y\nspec: G (pressed => F[0,1] y > 0)")
    rows = "".join(f"{cell},{y}\n" for cell, y in zip(cells.split(","), [-1, 0.5, -1], strict=True))
    (tmp_path / "trace.csv").write_text(f"pressed,y\n{rows}")
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.csv") == 0
    out = capsys.readouterr().out
    assert "robustness   +0.5\n" in out
    assert "pressed, true or false" in out


PATROL = "signal ee[2]\nsignal v\nspec: G (ee.x < 1 & ee.y < 2 & v < 3)"


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("ee.x;ee.y;v\n0,5;1,5;0\n0,75;0;0\n", []),
        ("ee.x;ee.y;v\n0.5;1.5;0\n0.75;0;0\n", []),
        ("ee.x\tee.y\tv\n0.5\t1.5\t0\n0.75\t0\t0\n", []),
        ("# run 7\nee.x;ee.y;v\n# pause\n0,5;1,5;0\n0,75;0;0\n", []),
        ("ee_x,ee_y,v\n0.5,1.5,0\n0.75,0,0\n", []),
        ("ee_0,ee_1,v\n0.5,1.5,0\n0.75,0,0\n", []),
        ("ee.x,ee_x,ee.y,v\n0.5,9,1.5,0\n0.75,9,0,0\n", []),
        ("pose.x,pose.y,speed\n0.5,1.5,0\n0.75,0,0\n", ["--signal", "ee=pose.x,pose.y", "--signal", "v=speed"]),
    ],
)
def test_forms_of_a_trace(text, arguments, tmp_path, capsys):
    (tmp_path / "task.tltl").write_text(PATROL)
    (tmp_path / "trace.csv").write_text(text)
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.csv", *arguments) == 0
    assert "robustness   +0.25\n" in capsys.readouterr().out


EE, V = [[0.5, 1.5], [0.75, 0]], [0, 0]


@pytest.mark.parametrize(
    ("arrays", "arguments"),
    [
        ({"ee": EE, "v": V}, []),
        ({"ee": [EE], "v": [V], "other": "text"}, []),
        ({"pose": EE, "speed": V}, ["--signal", "ee=pose", "--signal", "v=speed"]),
        ({"x": [0.5, 0.75], "y": [1.5, 0], "v": V}, ["--signal", "ee=x,y"]),
    ],
)
def test_a_trace_of_arrays(arrays, arguments, tmp_path, capsys):
    (tmp_path / "task.tltl").write_text(PATROL)
    np.savez(tmp_path / "trace.npz", **arrays)
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.npz", *arguments) == 0
    assert "robustness   +0.25\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arrays", "arguments", "told"),
    [
        ({"ee": EE}, [], r"trace.npz: there is no array v; there are: ee"),
        ({"ee": [EE, EE], "v": V}, [], r"trace.npz: ee has shape \(2, 2, 2\); expected \(T, 2\), one trajectory"),
        ({"ee": EE, "v": ["a", "b"]}, [], r"trace.npz: v holds <U1; expected numbers"),
        ({"ee": EE, "v": np.array([{}, None])}, [], r"trace.npz: the trace is no NPZ file of numbers: Object arrays"),
        ({"ee": np.empty((0, 2)), "v": []}, [], r"trace.npz: ee holds no samples"),
        ({"ee": EE, "v": V}, ["--signal", "e=v"], r"--signal e=...: the spec has no signal e; did you mean ee"),
        ({"ee": EE, "v": V}, ["--signal", "v=v,v"], r"--signal v=v,v: 2 names; expected 1"),
        ({"ee": EE, "v": V}, ["--signal", "v"], r"--signal v: expected each signal once, with its columns"),
    ],
)
def test_a_wrong_trace_of_arrays(arrays, arguments, told, tmp_path):
    (tmp_path / "task.tltl").write_text(PATROL)
    np.savez(tmp_path / "trace.npz", **arrays)
    with pytest.raises(UserError, match=told):
        tltl(tmp_path / "task.tltl", tmp_path / "trace.npz", *arguments)
    (tmp_path / "trace.npz").write_text("ee,v")
    with pytest.raises(UserError, match=r"--signal|trace.npz: the trace is no NPZ file"):
        tltl(tmp_path / "task.tltl", tmp_path / "trace.npz", *arguments)


def test_times_of_arrays(tmp_path, capsys):
    (tmp_path / "task.tltl").write_text("F[0 s, 0.1 s] x > 0")
    np.savez(tmp_path / "trace.npz", x=[-1, -1, 1, -1], time=[7, 7.05, 7.1, 7.15])
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.npz") == 0
    assert "period       0.05 s" in capsys.readouterr().out
    np.savez(tmp_path / "trace.npz", x=[-1, -1, 1, -1], time=[7, 7.05, 7.1, 7.3])
    with pytest.raises(UserError, match=r"trace.npz: sample 3: time has a gap, from 7.1 to 7.3 s"):
        tltl(tmp_path / "task.tltl", tmp_path / "trace.npz")


def timed(tmp_path, times, spec="F[0 s, 0.1 s] x > 0.5", name="time"):
    (tmp_path / "task.tltl").write_text(spec)
    rows = "".join(f"{t},{x}\n" for t, x in zip(times, [0, 0, 1, 0, 0, 0], strict=False))
    (tmp_path / "trace.csv").write_text(f"{name},x\n{rows}")
    return tltl(tmp_path / "task.tltl", tmp_path / "trace.csv")


@pytest.mark.parametrize("name", ["time", "t", "Time", "time_s", "time [s]"])
@pytest.mark.parametrize("start", [0, 100])
def test_the_column_of_times_says_the_period(name, start, tmp_path, capsys):
    assert timed(tmp_path, [start + 0.05 * i for i in range(6)], name=name) == 0
    out = capsys.readouterr().out
    assert "period       0.05 s\nhorizon      the first 3 samples, 0.1 s\n" in out
    assert timed(tmp_path, [start + 0.1 * i for i in range(6)], name=name) == 1


@pytest.mark.parametrize(
    ("times", "period"),
    [
        ([0, 0.03, 0.07, 0.1, 0.13, 0.17], "0.0333333333333"),
        ([7.0, 7.0501, 7.0999, 7.1502, 7.1998, 7.25], "0.05"),
        ([0, 0.052, 0.104, 0.156, 0.208], "0.052"),
        ([0, 2.5, 5, 7.5], "2.5"),
        ([1e3, 1001, 1002.0], "1"),
        ([0, 0.123456, 0.246912, 0.370368, 0.493824, 0.61728], "0.123456"),
    ],
)
def test_times_of_a_clock_that_rounds_or_jitters(times, period, tmp_path, capsys):
    timed(tmp_path, times, "F[0 s, 0 s] x > 0.5")
    assert f"period       {period} s\n" in capsys.readouterr().out


def test_seconds_without_a_column_of_times(tmp_path, capsys):
    (tmp_path / "task.tltl").write_text("F[0 s, 0.1 s] x > 0.5")
    assert tltl(tmp_path / "task.tltl") == 0
    assert "horizon      depends on the sampling period\n" in capsys.readouterr().out
    with pytest.raises(UserError, match=r"trace.csv:1:1: the spec counts in seconds, and there is no column of times"):
        timed(tmp_path, range(6), name="step")
    with pytest.raises(UserError, match="there is no column of times"):
        timed(tmp_path, range(6), name="t")  # which counts samples
    assert timed(tmp_path, range(6), "period 0.05 s\nF[0 s, 0.1 s] x > 0.5", name="t") == 0


@pytest.mark.parametrize(
    ("times", "told"),
    [
        ([0, 0.05, 0.1, 0.08, 0.15], r"trace.csv:5:1: time runs backwards, from 0.1 to 0.08 s, where 0.05 s are usual"),
        ([0, 0.05, 0.1, 0.1, 0.15], r"trace.csv:5:1: time stands still, from 0.1 to 0.1 s"),
        ([0, 0.05, 0.1, 0.25, 0.3], r"trace.csv:5:1: time has a gap, from 0.1 to 0.25 s"),
        ([0, 0.05, 0.1, 0.11, 0.16], r"trace.csv:5:1: time is uneven, from 0.1 to 0.11 s"),
    ],
)
def test_times_that_do_not_go_on_evenly(times, told, tmp_path):
    with pytest.raises(UserError, match=told):
        timed(tmp_path, times)
    assert timed(tmp_path, times, "F[0, 2] x > 0.5") == 0  # which asks for no time


def test_two_periods_that_disagree(tmp_path):
    with pytest.raises(UserError, match=r"trace.csv:1:1: the samples are 0.1 s apart, but the spec says 0.05 s"):
        timed(tmp_path, [0.1 * i for i in range(6)], "period 0.05 s\nF[0 s, 0.1 s] x > 0.5")


def test_a_device_is_no_file(tmp_path):
    (tmp_path / "task.tltl").write_text("F G x < 1")
    with pytest.raises(UserError, match="/dev/zero: the trace is a device; expected a file"):
        check(tmp_path / "task.tltl", "/dev/zero", out=io.StringIO())
    with pytest.raises(UserError, match="/dev/zero: the spec is a device; expected a file"):
        check("/dev/zero", out=io.StringIO())


def test_a_picture_of_many_curves(tmp_path):
    """Thirty components and twenty sub-formulas are a band each, so that legend and page stay readable."""
    parts = "".join(f"def p{i}: q[{i}] < 2\n" for i in range(20))
    (tmp_path / "task.tltl").write_text(f"signal q[30]\n{parts}spec: G (p7 & p8)")
    header = ",".join(f"q[{i}]" for i in range(30))
    (tmp_path / "trace.csv").write_text(header + "\n" + (",".join("1" for _ in range(30)) + "\n") * 5)
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.csv", "--plot", tmp_path / "picture.svg") == 0
    shown = re.findall(r"<!--  ?(.*?) -->", (tmp_path / "picture.svg").read_text())
    assert {"q[0] to q[29]", "p0 to p19", "p7", "spec"} <= set(shown)
    assert not {"q[1]", "p1"} & set(shown)


def test_a_component_in_both_spellings(trace):
    with pytest.raises(UserError, match=r"trace.csv:1:3: there are 2 columns ee.x; expected one"):
        tltl(SPECS / "reach_avoid.tltl", trace("ee.x,ee.y,ee[0]"))


def test_what_is_not_there(tmp_path):
    with pytest.raises(UserError, match=r"no spec file .*none.tltl here or in .*specs; there are: reach_avoid.tltl"):
        check(tmp_path / "none.tltl")
    (tmp_path / "task.tltl").write_text("F G x < 1")
    with pytest.raises(UserError, match=r"none.csv: the trace cannot be read"):
        check(tmp_path / "task.tltl", tmp_path / "none.csv", out=io.StringIO())


def test_a_value_of_zero_has_no_sign_of_its_own(tmp_path, capsys):
    (tmp_path / "task.tltl").write_text("!(x < 1)")
    (tmp_path / "trace.csv").write_text("x\n1\n")
    assert tltl(tmp_path / "task.tltl", tmp_path / "trace.csv") == 1
    out = capsys.readouterr().out
    assert "robustness   +0\n" in out
    assert "verdict      undecided\n" in out


def test_a_mistake_is_one_message_and_exit_code_2(tmp_path, capsys):
    (tmp_path / "task.tltl").write_text("F G y < 1")
    (tmp_path / "trace.csv").write_text("x\n1\n")
    with pytest.raises(SystemExit) as left:
        main(["check", str(tmp_path / "task.tltl"), str(tmp_path / "trace.csv")])
    assert left.value.code == 2
    told = capsys.readouterr().err
    assert told == f"tltl: {tmp_path}/trace.csv:1:1: there is no column y; there are: x\n"
