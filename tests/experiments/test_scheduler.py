"""A scheduler and its workers in one process: who refuses, who is waited for, and what is told when one is gone.

A process apart: after Dask's threads have run in one, no other test could fork from it.
"""

import json
import os
import socket
import threading
import traceback
from pathlib import Path
from types import SimpleNamespace

import pytest

from tltlrl.errors import UserError
from tltlrl.experiments import scheduler
from tltlrl.experiments.origin import code_digest, different, machine, origin
from tltlrl.registry import Registry

RUN = SimpleNamespace(task=SimpleNamespace(name="reach_avoid"), case=SimpleNamespace(learner="episodic"))
JOBS = [(RUN, Path("0")), (RUN, Path("1"))]


def of_this_side(*_):
    return {"numpy": "2.4" if threading.current_thread() is threading.main_thread() else "2.3"}


def computed(cluster, then):
    """What was said, how the jobs ended, and the mistake; `then` is done when something is said."""
    said, ended, mistake = [], {}, ""

    def say(line):
        said.append(line)
        then(cluster)

    try:
        scheduler.run_on_scheduler(
            cluster.scheduler_address, JOBS, lambda *_: None, lambda index, *rest: ended.update({index: rest}), say
        )
    except UserError as error:
        mistake = str(error)
    return {"address": cluster.scheduler_address, "said": said, "ended": ended, "mistake": mistake}


def with_a_cluster(workers, then):
    from distributed import LocalCluster

    options = {"processes": False, "protocol": "tcp://", "dashboard_address": "127.0.0.1:0"}
    with LocalCluster("127.0.0.1", n_workers=workers, **options) as cluster:
        return computed(cluster, then)


def asked(address):
    try:
        scheduler.check_scheduler(address)
    except UserError as error:
        return str(error)
    return ""


def answered(answer):
    """What is told of a peer that answers this."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            for _ in range(2):
                peer, _ = server.accept()
                with peer:
                    peer.sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        return asked(f"tcp://127.0.0.1:{server.getsockname()[1]}")


def scenes():
    """Of workers that compute nothing, and say so at once."""
    scheduler.train = lambda run, folder, report: report(1)  # noqa: ARG005
    scheduler.SILENCE_SECONDS = 0.1
    scheduler.SCHEDULER_SECONDS = 2
    of_both = scheduler.origin
    yield "late", with_a_cluster(0, lambda cluster: cluster.scale(1))
    yield "lost", with_a_cluster(0, lambda cluster: cluster.close())
    scheduler.SILENCE_SECONDS, scheduler.origin = 60, of_this_side
    yield "other", with_a_cluster(1, lambda _: None)
    scheduler.origin = of_both
    yield "ssh", answered(b"SSH-2.0-OpenSSH_9.2\r\n")
    yield "http", answered(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 9)
    yield "zeros", answered(b"\x00" * 64)
    yield "tls", asked("tls://127.0.0.1:1")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """What came of every scene, and what was written to standard error on the way."""
    folder = tmp_path_factory.mktemp("scenes")
    pid = os.fork()
    if pid == 0:
        try:
            with open(folder / "errors", "w") as errors:
                os.dup2(errors.fileno(), 2)
                (folder / "found.json").write_text(json.dumps(dict(scenes())))
        except BaseException:
            (folder / "errors").write_text(traceback.format_exc())
        finally:
            os._exit(0)
    os.waitpid(pid, 0)
    errors = (folder / "errors").read_text()
    assert (folder / "found.json").exists(), errors
    return json.loads((folder / "found.json").read_text()) | {"errors": errors}


def test_it_is_told_that_there_is_no_worker_and_the_runs_begin_when_one_comes(scene):
    late = scene["late"]
    assert late["ended"] == {"0": [None, machine()], "1": [None, machine()]}
    assert late["said"] == [
        f"no worker is connected to the scheduler at {late['address']}; start one, as with `dask worker "
        f"{late['address']} --nthreads 1`; waiting for it"
    ]


def test_a_worker_with_other_versions_computes_nothing_and_says_what_differs(scene):
    other = scene["other"]
    assert other["ended"] == {}
    (line,) = other["said"]
    assert line.startswith("the worker at tcp://127.0.0.1:")
    assert line.endswith(f", {machine()}, computes nothing: numpy: 2.3 there, 2.4 here")
    assert other["mistake"] == (
        f"engine.address: no worker of {other['address']} has what this command has; give all of them the same "
        "environment and the same version of tltlrl, and start the same command again"
    )


def test_a_scheduler_that_is_lost_is_told_with_its_address_and_without_a_traceback(scene):
    lost = scene["lost"]
    assert lost["mistake"] == (
        f"engine.address: the scheduler at {lost['address']} is gone; start it and its workers, and the same command "
        "again: what is done is kept"
    )
    assert scene["errors"] == ""


@pytest.mark.parametrize("peer", ["ssh", "http", "zeros"])
def test_a_peer_that_is_not_dask_is_told(scene, peer):
    assert scene[peer].startswith("engine.address: no scheduler answers at tcp://127.0.0.1:")
    assert len(scene[peer].splitlines()) == 1
    assert scene[peer].endswith("; start one with `dask scheduler`, or leave it out")


def test_tls_without_certificates_is_told_before_anything_is_connected_to(scene):
    assert scene["tls"] == (
        "engine.address: tls:// needs certificates, and Dask is told of none (distributed.comm.tls.ca-file); set "
        "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, or see docs/clusters.md"
    )


def test_code_of_other_packages_counts_where_a_run_uses_it(package):
    ours, theirs = origin("reach_avoid", "episodic"), origin("short_arm", "careful")
    assert theirs.keys() - ours.keys() == {"code of the task short_arm", "code of the learner careful"}
    assert theirs["code of the task short_arm"] == code_digest("elsewhere")
    assert different(ours, ours | {"numpy": "0.1"}) == f"numpy: 0.1 there, {ours['numpy']} here"
    assert package.is_dir()


def test_versions_of_what_a_task_or_a_learner_computes_with_count():
    ours = origin("reach_avoid", "episodic")
    assert origin("reach_avoid", "cma").keys() - ours.keys() == {"cma"}
    assert origin("gymnasium", "episodic").keys() - ours.keys() == {"gymnasium"}
    assert all(ours[name] != "none" for name in ("numpy", "scipy", "mujoco", "dm-control"))


def test_a_package_that_cannot_be_imported_leaves_the_refusal_to_its_code(monkeypatch):
    def broken(*_):
        raise RuntimeError("no licence")

    monkeypatch.setattr(Registry, "get", broken)
    assert "numpy" in origin("reach_avoid", "episodic")
