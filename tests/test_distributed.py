"""A scheduler and workers of their own, as on a cluster; one worker is killed on the way."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SETTINGS = (
    "experiment=reach_avoid", "name=small", "seeds=3", "cases=[tltl_episodic]", "algorithm.iterations=40",
    "algorithm.samples=8", "algorithm.epsilon=0.5", "task.steps=60", "trials=3",
)  # fmt: skip


def tltl_run(folder, *arguments):
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from tltlrl.cli import run; sys.exit(run(sys.argv[1:]))", *arguments],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    files = sorted(folder.glob("runs/small/**/progress.csv")) + sorted(folder.glob("runs/small/**/policy.npz"))
    return {str(path.relative_to(folder)): path.read_bytes() for path in [*files, folder / "runs/small/summary.csv"]}


@pytest.fixture
def cluster(tmp_path):
    """Address of a scheduler with two worker processes, and the processes."""
    address = tmp_path / "address.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    dask = [str(Path(sys.executable).with_name("dask"))]
    options = ["--scheduler-file", str(address), "--no-dashboard"]
    scheduler = subprocess.Popen([*dask, "scheduler", "--port", "0", "--host", "127.0.0.1", *options], **quiet)
    worker = [*dask, "worker", "--nthreads", "1", "--no-nanny", *options]
    workers = [subprocess.Popen(worker, **quiet) for _ in range(2)]
    deadline = time.monotonic() + 60
    while not address.exists() and time.monotonic() < deadline:
        time.sleep(0.1)
    yield json.loads(address.read_text())["address"], workers
    for process in [*workers, scheduler]:
        process.kill()
        process.wait()


def test_a_scheduler_of_ones_own_gives_the_same_bytes_even_if_a_worker_is_killed(cluster, tmp_path):
    address, workers = cluster
    for name in ("alone", "spread"):
        (tmp_path / name).mkdir()
    alone = tltl_run(tmp_path / "alone", *SETTINGS, "workers=1")
    pid = os.fork()
    if pid == 0:  # kills one worker once the first rows are there
        while not list(tmp_path.glob("spread/runs/small/*/*/progress.csv")):
            time.sleep(0.01)
        time.sleep(0.3)
        os.kill(workers[0].pid, signal.SIGKILL)
        os._exit(0)
    spread = tltl_run(tmp_path / "spread", *SETTINGS, f"engine.address={address}", f"runs_dir={tmp_path}/spread/runs")
    os.waitpid(pid, 0)
    assert workers[0].poll() is not None
    assert spread == alone


def test_a_scheduler_that_is_not_there_is_told(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from tltlrl.cli import run; sys.exit(run(sys.argv[1:]))", *SETTINGS,
         "engine.address=tcp://127.0.0.1:1"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "engine.address: no scheduler answers at tcp://127.0.0.1:1 (" in done.stderr
    assert not (tmp_path / "runs").exists()
    assert "Traceback" not in done.stderr
