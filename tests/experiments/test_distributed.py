"""A scheduler and workers of their own, as on a cluster; one worker is killed on the way."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import dask
import distributed
import forked
import hydra
import pytest
from distributed.cli import dask_scheduler, dask_worker

from tltlrl.config.compare import flatten
from tltlrl.config.compose import compose, initialized, parse
from tltlrl.errors import UserError
from tltlrl.experiments import scheduler

SETTINGS = (
    "experiment=reach_avoid", "name=small", "seeds=3", "cases=[tltl_episodic]", "algorithm.iterations=150",
    "algorithm.samples=8", "algorithm.epsilon=0.5", "task.steps=60", "trials=3",
)  # fmt: skip


def tltl_run(folder, *arguments):
    code, _, errors = forked.tltl_run(folder, *arguments, first=forked.without_pictures)
    assert code == 0, errors
    files = sorted(folder.glob("runs/small/**/progress.csv")) + sorted(folder.glob("runs/small/**/policy.npz"))
    return {str(path.relative_to(folder)): path.read_bytes() for path in [*files, folder / "runs/small/summary.csv"]}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Address of a scheduler with two worker processes, and the processes; one test leaves only the second worker."""
    folder = tmp_path_factory.mktemp("cluster")
    address = folder / "address.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    dask = [str(Path(sys.executable).with_name("dask"))]
    options = ["--scheduler-file", str(address), "--no-dashboard"]
    scheduler = subprocess.Popen([*dask, "scheduler", "--port", "0", "--host", "127.0.0.1", *options], **quiet)
    worker = [*dask, "worker", "--nthreads", "1", "--no-nanny", *options]
    workers = [subprocess.Popen(worker, **quiet) for _ in range(2)]
    deadline = time.monotonic() + 60
    while not (address.exists() and address.read_text()) and time.monotonic() < deadline:  # may be empty
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
    if pid == 0:  # kills one worker when each is in the middle of a run
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            begun = {path.parent for path in tmp_path.glob("spread/runs/small/*/*/progress.csv")}
            ended = {path.parent for path in tmp_path.glob("spread/runs/small/*/*/done.json")}
            if len(begun - ended) == 2:
                os.kill(workers[0].pid, signal.SIGKILL)
                os._exit(0)
            time.sleep(0.01)
        os._exit(1)
    try:
        arguments = (f"engine.address={address}", f"runs_dir={tmp_path}/spread/runs")
        spread = tltl_run(tmp_path / "spread", *SETTINGS, *arguments)
    finally:
        _, status = os.waitpid(pid, 0)
    assert status == 0, "two runs were never under way at once"
    assert workers[0].wait(10) == -signal.SIGKILL
    assert spread == alone


def test_ctrl_c_with_ten_thousand_runs_waiting_ends_at_once(cluster, tmp_path):
    def interrupt():
        wait_for(lambda: list(tmp_path.glob("runs/small/*/*/progress.csv")))
        (tmp_path / "since").touch()
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(60)
        os._exit(1)  # it goes on with ten thousand runs

    code, _, errors = forked.tltl_run(
        tmp_path, *SETTINGS, "seeds=10000", f"engine.address={cluster[0]}",
        first=lambda: threading.Thread(target=interrupt, daemon=True).start(),
    )  # fmt: skip
    assert code == 130, errors
    assert time.time() - (tmp_path / "since").stat().st_mtime < 10  # 1 s on a machine with nothing else to do
    assert errors.endswith("tltl-run: stopped; the same command continues from what is done\n")
    assert "Traceback" not in errors


def wait_for(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.01)


def test_a_scheduler_that_is_not_there_is_told(tmp_path):
    code, _, errors = forked.tltl_run(tmp_path, *SETTINGS, "engine.address=tcp://127.0.0.1:1")
    assert code == 2
    assert "engine.address: no scheduler answers at tcp://127.0.0.1:1 (" in errors
    assert not (tmp_path / "runs").exists()
    assert "Traceback" not in errors


@pytest.mark.parametrize("who", ["silent", "worker"])
def test_what_answers_but_is_no_scheduler_is_told(who, monkeypatch, request):
    monkeypatch.setattr(scheduler, "SCHEDULER_SECONDS", 2)
    if who == "silent":
        listener = socket.create_server(("127.0.0.1", 0))
        request.addfinalizer(listener.close)
        address, reason = f"tcp://127.0.0.1:{listener.getsockname()[1]}", ""
    else:
        there, _ = request.getfixturevalue("cluster")
        from distributed import Client

        with Client(there, set_as_default=False) as client:
            client.wait_for_workers(1, timeout=30)
            (address, *_), reason = client.scheduler_info()["workers"], "there is a Worker"
    with pytest.raises(UserError, match=rf"no scheduler answers at {address} \({reason}.*\); start one"):
        scheduler.check_scheduler(address)


@pytest.mark.parametrize(("lows", "code"), [("-9", 0), ("9,-9", 1)])
def test_hydras_submitit_launcher_gives_each_combination_a_process_and_its_failure_an_exit_code(tmp_path, lows, code):
    """The root has no value where the arm is below `low`."""
    (tmp_path / "root.tltl").write_text("signal ee[2]\nconst low = 0\nspec: F G (sqrt(ee.y - low) > 0.3)\n")
    small = ("experiment=reach_avoid", "name=small", "seeds=1", "cases=[tltl_episodic]", "algorithm.iterations=2",
             "spec=root.tltl", "algorithm.samples=8", "task.steps=20", "trials=2", "workers=1")  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-c", "import sys; from tltlrl.cli.main import run; sys.exit(run(sys.argv[1:]))", "-m",
         "hydra/launcher=submitit_local", *small, f"constants.low={lows}", "algorithm.epsilon=0.5"],
        cwd=tmp_path, env=forked.sketched(), capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    finished = [path.parent.name for path in tmp_path.glob("runs/*/summary.csv")]
    assert finished == (["small,constants.low=-9"] if code else ["small"])  # whatever the other one did
    if code:
        assert "1 of 2 experiments failed: small,constants.low=9;" in done.stderr
        logs = [path.read_text() for path in tmp_path.glob("runs/.submitit/*/*.err")]
        assert any("FAILED: TraceError" in log for log in logs)


def test_the_clusters_pages_commands(tmp_path):
    """The first block of docs/clusters.md as written, in small, and the job script's as far as bash can tell."""
    page = (Path(__file__).parents[2] / "docs/clusters.md").read_text()
    (tmp_path / ".venv").symlink_to(sys.prefix)
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    block = page.split("```sh\n")[1].split("```")[0].replace("8786", str(port))
    small = " ".join(SETTINGS).replace("iterations=150", "iterations=2").replace("experiment=reach_avoid ", "")
    command = block.replace("tltl-run experiment=reach_avoid", f"tltl-run experiment=reach_avoid {small}")
    script = f"set -e\ntrap 'kill $(jobs -p)' EXIT\n{command}"
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=forked.sketched(), capture_output=True, text=True, timeout=120,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs/small/summary.csv").exists()
    sbatch = page.split("```sbatch\n")[1].split("```")[0]
    subprocess.run(["bash", "-n"], input=sbatch, text=True, check=True, timeout=10)


CLUSTERS = (Path(__file__).parents[2] / "docs/clusters.md").read_text(encoding="utf-8")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make a certificate with")
def test_the_certificate_of_the_page_is_what_dask_asks_for(tmp_path):
    """The second block: the certificate and the variables as written; the arguments of what it starts."""
    block = CLUSTERS.split("```sh\n")[2].split("```")[0]
    given, *started = re.split(r"(?=^dask scheduler)", block, maxsplit=1, flags=re.MULTILINE)
    done = subprocess.run(
        ["bash", "-euc", f"{given}env"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "key.pem").stat().st_mode & 0o077 == 0
    environment = dict(line.split("=", 1) for line in done.stdout.splitlines() if line.startswith("DASK_"))
    with dask.config.set(flatten(dask.config.collect_env(environment))):
        security = distributed.Security()
        assert security.require_encryption
        for role in ("scheduler", "worker", "client"):
            assert security.get_connection_args(role)["ssl_context"]
    scheduler_line, worker_line, _, run_line = started[0].replace("&", "").splitlines()
    for command, line in ((dask_scheduler, scheduler_line), (dask_worker, worker_line)):
        assert command.main.make_context("dask", line.split()[2:])
    assert compose(run_line.split()[1:])["engine"]["address"].startswith("tls://")


def test_the_launchers_of_the_page_have_its_keys():
    """SLURM is not there to be asked; the keys of Hydra's launcher are."""
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    jobs = re.findall(r"^    sbatch .*?tltl\.sbatch (.*)$", CLUSTERS, re.MULTILINE)
    assert len(jobs) == 2
    for line in jobs:
        assert compose(line.split())
    (line,) = re.findall(r"^    tltl-run -m (.*)$", CLUSTERS.replace("\\\n", " "), re.MULTILINE)
    launcher = [word for word in line.split() if word.startswith("hydra")]
    with initialized():
        config = hydra.compose("config", [*launcher, "experiment=reach_avoid"], return_hydra_config=True)
    assert config.hydra.launcher.timeout_min == 240
    for override in parse([word for word in line.split() if not word.startswith("hydra")]):
        assert override.key_or_group in ("experiment", "workers", "algorithm.epsilon")
