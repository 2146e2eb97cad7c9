"""What the commands say where nobody listens, where names hold control characters, and for want of memory."""

import io
import os
import sys

import pytest

from tltlrl.cli.main import main, mistakes_told
from tltlrl.errors import UserError
from tltlrl.experiments.progress import Progress


class Full(io.StringIO):
    def write(self, _):
        raise OSError(28, "No space left on device")


def test_a_full_standard_error_stops_nothing(tmp_path, monkeypatch):
    with Progress(["a"], 3, tmp_path / "log.txt", stream=Full()) as progress:
        progress.say("first")
        progress.end(0, None)
    assert [line.split(" ", 2)[2] for line in (tmp_path / "log.txt").read_text().splitlines()] == [
        "first", "1/1 done; a finished",
    ]  # fmt: skip
    monkeypatch.setattr(sys, "stderr", Full())

    def wrong():
        raise UserError("a mistake")

    assert mistakes_told("tltl", wrong) == 2


def test_with_closed_streams_a_command_works_and_writes_into_no_other_file(tmp_path):
    pid = os.fork()
    if pid == 0:
        code = 3
        try:
            os.closerange(0, 3)
            sys.stdin = sys.stdout = sys.stderr = None
            (tmp_path / "a.tltl").write_text("G (x < 1)\n")
            main(["check", str(tmp_path / "a.tltl")])
        except SystemExit as ended:
            code = ended.code
            first = os.open(tmp_path / "next", os.O_CREAT | os.O_WRONLY)
            code = code or (0 if first > 2 else 4)
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0


def test_no_control_character_of_a_name_reaches_the_terminal(tmp_path, capsys):
    spec = tmp_path / "a\x1b[31mred.tltl"
    spec.write_text("G (x < 3)")
    trace = tmp_path / "b\x07.csv"
    trace.write_text("x\x1b[31m,y\n1,2\n")
    with pytest.raises(SystemExit):
        main(["check", str(spec)])
    with pytest.raises(SystemExit):
        main(["check", str(spec), str(trace)])
    printed = capsys.readouterr()
    assert "a?[31mred.tltl" in printed.out
    assert "b?.csv:1:1: there is no column x; there are: x?[31m, y" in printed.err
    assert not {"\x1b", "\x07"} & {*printed.out, *printed.err}


@pytest.mark.parametrize(
    "error",
    [
        MemoryError(),
        ValueError("Error: engine error: Could not allocate memory"),
        ImportError("scipy/linalg/_x.so: failed to map segment from shared object"),
        RecursionError("maximum recursion depth exceeded"),
    ],
)
def test_want_of_memory_is_one_message_whoever_notices_it(capsys, error):
    def command():
        raise error

    assert mistakes_told("tltl-run", command) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(
        "tltl-run: there is not enough memory" if not isinstance(error, RecursionError) else "tltl-run: a given file"
    )


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (["evaluate", "nothing"], 1_000_000),
        (["check", "a.tltl", "--plot=a.png"], 1_000_000),
        (["check", "a.tltl"], 250_000),
    ],
)
def test_a_limit_of_memory_is_told_before_blas_waits_for_more(monkeypatch, capsys, arguments, needed):
    monkeypatch.setattr("os.environ", dict(os.environ))
    monkeypatch.setattr("resource.getrlimit", lambda _: (200_000 * 1024, -1))
    with pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert capsys.readouterr().err == (
        f"tltl: there is not enough memory: tltl {arguments[0]} needs {needed} kB of address space or more, and "
        "ulimit -v is 200000; raise it\n"
    )
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
