"""The worker processes of this machine: who dies, who connects, who is interrupted."""

import contextlib
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from computations import steps

from tltlrl.errors import UserError
from tltlrl.experiments.processes import _without_interrupt, run_in_processes

HERE = Path(__file__).parent


def ends(runs, folder, workers=2, compute=steps):
    """Index of a job => its error, as they were told."""
    told = {}
    run_in_processes(compute, [(run, folder) for run in runs], workers, lambda *_: None, told.__setitem__)
    return told


def begun(folder, run):
    """The processes that have begun it."""
    return [int(path.name.rpartition(".")[2]) for path in folder.glob(f"{run}.*")]


def alive(pid):
    """Whether there is such a process, which has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_the_run_of_a_worker_that_dies_is_taken_up_and_one_that_kills_all_is_given_up(tmp_path):
    told = ends(["dies once", "fine", "dies", "fails", "says what no pipe carries"], tmp_path)
    assert told[0] is None
    assert told[1] is None
    assert len(begun(tmp_path, "dies once")) == 2
    assert str(told[2]) == "its worker died 4 times, the last time with signal 9"
    assert len(begun(tmp_path, "dies")) == 4
    assert (told[3].errno, told[3].filename) == (28, str(tmp_path / "policy.npz"))
    assert str(told[4]) == "Unpicklable: in words"


def listening():
    """Inodes of the sockets of this machine that somebody could connect to, or send to."""
    inodes = set()
    for name, listens in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
        table = Path(f"/proc/net/{name}")
        rows = [line.split() for line in table.read_text().splitlines()[1:]] if table.exists() else []
        inodes |= {row[9] for row in rows if row[3] == listens}
    rows = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:]]
    return inodes | {row[6] for row in rows if len(row) > 7}  # those that have a name


@pytest.mark.skipif(not Path("/proc/net/unix").exists(), reason="sockets are found in Linux's /proc")
def test_nobody_can_connect_to_a_worker_and_all_end_when_the_command_is_interrupted(tmp_path):
    """10,000 runs are waiting; a Ctrl-C ends all within 2 s."""
    seen, interrupted = [], []

    def look():
        deadline = time.monotonic() + 60
        while len(begun(tmp_path, "lasts")) < 2 and time.monotonic() < deadline:
            time.sleep(0.01)
        sockets = listening()
        for pid in (os.getpid(), *begun(tmp_path, "lasts")):
            for descriptor in Path(f"/proc/{pid}/fd").iterdir():
                target = os.readlink(descriptor) if descriptor.is_symlink() else ""
                seen.append((pid, target, target.removeprefix("socket:[").rstrip("]") in sockets))
        interrupted.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    observer = threading.Thread(target=look)
    observer.start()
    with pytest.raises(KeyboardInterrupt):
        ends(["lasts"] * 10_000, tmp_path)
    assert time.monotonic() - interrupted[0] < 10  # 0.1 s on a machine with nothing else to do
    observer.join()
    pids = begun(tmp_path, "lasts")
    assert len(pids) == 2
    assert not any(map(alive, pids))
    assert {pid for pid, *_ in seen} == {os.getpid(), *pids}
    assert not [entry for entry in seen if entry[2]]


def test_workers_end_with_a_command_that_is_killed(tmp_path):
    script = (
        f"import sys; sys.path.insert(0, {str(HERE)!r})\n"
        "from pathlib import Path; from test_processes import ends; ends(['lasts'] * 3, Path(sys.argv[1]))"
    )
    command = subprocess.Popen([sys.executable, "-c", script, str(tmp_path)])
    deadline = time.monotonic() + 60
    while len(begun(tmp_path, "lasts")) < 2 and time.monotonic() < deadline:
        time.sleep(0.01)
    command.kill()
    command.wait()
    pids = begun(tmp_path, "lasts")
    assert len(pids) == 2
    deadline = time.monotonic() + 10
    while any(map(alive, pids)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not any(map(alive, pids))


@pytest.fixture
def eight_descriptors():
    """As many are left, which is not enough for three workers."""
    before, opened = resource.getrlimit(resource.RLIMIT_NOFILE), []
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, before[1]))
    with contextlib.suppress(OSError):
        while True:
            opened.append(os.open(os.devnull, os.O_RDONLY))
    for descriptor in opened[:8]:
        os.close(descriptor)
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)
    for descriptor in opened[8:]:
        os.close(descriptor)


@pytest.mark.usefixtures("eight_descriptors")
def test_too_few_descriptors_for_so_many_workers_are_told(tmp_path):
    with pytest.raises(UserError, match=r"^workers=3: there are not enough file descriptors .* with ulimit -n$"):
        ends(["lasts"] * 3, tmp_path, 3)


def test_a_worker_that_cannot_import_what_it_needs_is_told(tmp_path, monkeypatch):
    module = type(sys)("only_here")
    exec("def steps(run, folder, report): pass", module.__dict__)
    monkeypatch.setitem(sys.modules, "only_here", module)
    module.steps.__module__ = "only_here"
    with pytest.raises(UserError, match="could not be started: ModuleNotFoundError: No module named 'only_here'"):
        ends(["any"], tmp_path, 1, module.steps)


def test_an_interrupt_waits_for_a_worker_that_is_being_started_even_if_another_thread_gets_it():
    within, before, ended = threading.Event(), signal.getsignal(signal.SIGINT), []

    def interrupt():
        within.wait()
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)

    def start():
        with _without_interrupt():
            within.set()
            other.join()
            ended.append(sum(range(1000)))

    other = threading.Thread(target=interrupt)
    other.start()
    with pytest.raises(KeyboardInterrupt):
        start()
    assert ended == [499500]
    assert signal.getsignal(signal.SIGINT) is before
