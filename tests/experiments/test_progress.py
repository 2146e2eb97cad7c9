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


@pytest.mark.parametrize(
    ("stream", "said"),
    [(io.StringIO(), "a at iteration 31/90, robustness -0.125\n"), (Terminal(), "a, robustness -0.125]")],
    ids=["lines", "bar"],
)
def test_the_robustness_so_far_is_said(tmp_path, monkeypatch, stream, said):
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with Progress(["b", "a"], 90, tmp_path / "log.txt", [None, -0.125].__getitem__, stream) as bar:
        for i in range(40):
            now[0] += 1.0
            bar.advance(1, i + 1)
    assert said in stream.getvalue()
