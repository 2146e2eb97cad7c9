import io

import pytest

from tltlrl.experiments import progress
from tltlrl.experiments.progress import Progress


def test_plain_lines_without_a_terminal_count_and_estimate(tmp_path, monkeypatch):
    clock = iter([0.0, 0.0] + [10.0 * i for i in range(1, 100)])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    stream = io.StringIO()
    with Progress(["a", "b"], 10, tmp_path / "log.txt", stream=stream) as bar:
        for i in range(1, 11):
            bar.advance(0, i)
        bar.end(0, None)
        bar.end(1, ValueError("no signal"))
    lines = stream.getvalue().splitlines()
    assert any(line.startswith("0/2 done") and "left; a at iteration" in line for line in lines)
    assert any(line.startswith("1/2 done") and line.endswith("a finished") for line in lines)
    assert lines[-1].startswith("2/2 done, 1 failed")
    assert lines[-1].endswith("b FAILED: ValueError: no signal")
    log = (tmp_path / "log.txt").read_text().splitlines()
    assert [line[20:] for line in log] == lines


class ClosedPipe(io.StringIO):
    def write(self, _):
        raise BrokenPipeError


def test_whoever_stops_reading_stops_nothing(tmp_path):
    with Progress(["a"], 10, tmp_path / "log.txt", stream=ClosedPipe()) as bar:
        bar.say("before")
        bar.end(0, None)
    assert [line[20:] for line in (tmp_path / "log.txt").read_text().splitlines()] == ["before", "1/1 done; a finished"]


def test_lines_are_at_least_half_a_minute_apart(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    with Progress(["a"], 1000, tmp_path / "log.txt", stream=stream) as bar:
        for i in range(1000):
            now[0] += 0.1
            bar.advance(0, i + 1)
    assert len(stream.getvalue().splitlines()) == 3  # 100 seconds


def test_calm_batches_are_work_like_iterations(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    with Progress(["a", "b"], 20, tmp_path / "log.txt", stream=stream, calm=60) as bar:
        for i in range(1, 62):  # one a second
            now[0] += 1.0
            bar.advance(0, i)
        bar.end(0, None)
    assert stream.getvalue().splitlines() == [
        "0/2 done, 2 min 09 s left; a at calm batch 11/60",
        "1/2 done, 1 min 01 s left; a finished",
    ]


def test_what_an_earlier_session_did_does_not_shorten_the_estimate(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    with Progress(["a"], 200, tmp_path / "log.txt", stream=stream) as bar:
        for i in range(101, 141):  # went on from a checkpoint, one iteration a second
            now[0] += 1.0
            bar.advance(0, i)
    assert stream.getvalue() == "0/1 done, 1 min 09 s left; a at iteration 131/200\n"


class Terminal(io.StringIO):
    def isatty(self):
        return True


SAID = "robustness -0.125, `G safe` decides 93 %"


@pytest.mark.parametrize(
    ("stream", "said"),
    [(io.StringIO(), f"a seed 1 at iteration 21/90, {SAID}\n"), (Terminal(), f"left, 40/90, {SAID}, seed 1")],
    ids=["lines", "bar"],
)
def test_where_a_run_stands_is_said(tmp_path, monkeypatch, stream, said):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with Progress(["b seed 0", "a seed 1"], 90, tmp_path / "log.txt", ["", SAID].__getitem__, stream) as bar:
        for i in range(40):
            now[0] += 1.5
            bar.advance(1, i + 1)
    assert said in stream.getvalue()


def test_a_terminal_of_80_columns_shows_what_decides(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    now, stream = [0.0], Terminal()
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with Progress(["continuous_episodic seed 1"], 90, tmp_path / "log.txt", lambda _: SAID, stream) as bar:
        for i in range(40):
            now[0] += 1.5
            bar.advance(0, i + 1)
    last = stream.getvalue().strip().splitlines()[-1]
    assert last.find(SAID) + len(SAID) in range(len(SAID), 80), last


def test_on_a_terminal_every_case_has_a_line(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    stream = Terminal()
    labels = ["tltl_cma seed 0", "tltl_cma seed 1", "discrete_step seed 0"]
    with Progress(labels, 10, tmp_path / "log.txt", stream=stream) as bar:
        bar.advance(0, 10)
        bar.advance(2, 10)
        bar.end(2, None)
    last = stream.getvalue().replace("\n", "\r").split("\r")
    assert any(line.startswith("tltl_cma       50 %") or "tltl_cma        50 %" in line for line in last)
    assert any("discrete_step 100 %" in line for line in last)
