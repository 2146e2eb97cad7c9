"""Where runs are computed: in this process, in processes of this machine, or on a running Dask scheduler.

All three call the same `train` on the same folders, so all three write the same bytes. The run of a worker that died is
given to another one; the run itself goes on from its checkpoint.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import socket
import time
import urllib.parse
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tltlrl.errors import UserError
from tltlrl.experiments.processes import run_in_processes
from tltlrl.training.session import train
from tltlrl.training.study import Run

TOPIC = "tltlrl-progress"
REPORT_SECONDS = 0.5
SCHEDULER_SECONDS = 10
CLOSE_SECONDS = 1
AHEAD = 2  # jobs per thread of the workers: while one is computed, the next one is there

# Of the processes of this machine, which inherit it: runs are what is parallel.
ENVIRONMENT = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

Job = tuple[Run, Path]
OnProgress = Callable[[int, int], None]  # (index of the job, iterations done)
OnEnd = Callable[[int, Exception | None], None]  # (index of the job, its error)


def run_all(jobs: list[Job], workers: int, address: str | None, on_progress: OnProgress, on_end: OnEnd) -> None:
    """Computes every job; one that fails is reported through `on_end` and the others go on.

    Args:
      jobs: runs and their folders.
      workers: processes of this machine; 1 computes in this process. Ignored with an address.
      address: of a Dask scheduler whose workers see the same files.
      on_progress, on_end: called in this process.

    Raises:
      UserError: if the scheduler cannot be reached, or no process be started.
      KeyboardInterrupt: on Ctrl-C, after the workers of this machine were stopped.
    """
    if address is None and workers == 1:
        for index, (run, folder) in enumerate(jobs):
            try:
                train(run, folder, lambda iteration, index=index: on_progress(index, iteration))  # type: ignore[misc]
            except Exception as error:
                on_end(index, error)
            else:
                on_end(index, None)
        return

    if address is None:
        for name, value in ENVIRONMENT.items():
            os.environ.setdefault(name, value)
        run_in_processes(train, jobs, workers, on_progress, on_end)
        return

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a closing client logs its broken connections
    client = _client(address)
    try:
        client.subscribe_topic(TOPIC, lambda event: on_progress(*event[1]))
        _run_on_scheduler(client, jobs, on_end)
    finally:
        with contextlib.suppress(
            TimeoutError
        ):  # Ctrl-C waits for nobody; the runs that are under way end by themselves
            client.close(timeout=CLOSE_SECONDS)


def _run_on_scheduler(client: Any, jobs: list[Job], on_end: OnEnd) -> None:
    """Gives the scheduler no more jobs than its workers will begin soon: thousands take it seconds to forget."""
    from distributed import as_completed

    waiting = deque(enumerate(jobs))
    futures: dict[Any, int] = {}  # => index of the job
    ended = as_completed(loop=client.loop)

    def give() -> None:
        most = AHEAD * max(1, sum(client.nthreads().values()))  # workers come and go
        while waiting and len(futures) < most:
            index, (run, folder) = waiting.popleft()
            future = client.submit(_on_worker, index, run, folder, pure=False)
            futures[future] = index
            ended.add(future)

    give()
    for future in ended:
        on_end(futures.pop(future), future.result() if future.status == "finished" else future.exception())
        give()


def _on_worker(index: int, run: Run, folder: Path) -> Exception | None:
    """The run's own error is a result: raised, Dask would log it as a fault of the worker."""
    from distributed import get_worker

    worker, last = get_worker(), 0.0

    def report(iteration: int) -> None:
        nonlocal last
        if time.monotonic() - last > REPORT_SECONDS:
            last = time.monotonic()
            worker.log_event(TOPIC, (index, iteration))

    try:
        train(run, folder, report)
    except Exception as error:
        return error
    return None


def check_scheduler(address: str) -> None:
    """Whether a scheduler answers at the address, before a folder is made for its results.

    Raises:
      UserError: if not.
    """
    parts = urllib.parse.urlsplit(address)
    try:
        if parts.scheme not in ("tcp", "tls") or parts.port is None:
            raise ValueError("it must be tcp://HOST:PORT or tls://HOST:PORT")
        socket.create_connection((parts.hostname or "", parts.port), timeout=SCHEDULER_SECONDS).close()
        if parts.scheme == "tcp":  # a tls:// one answers those alone who show their certificate
            kind = asyncio.run(asyncio.wait_for(_kind_of(address), SCHEDULER_SECONDS))
            if kind != "Scheduler":
                raise ValueError(f"there is a {kind}")
    except (OSError, ValueError) as error:
        reason = str(error) or f"no answer within {SCHEDULER_SECONDS} s"
        raise UserError(
            f"engine.address: no scheduler answers at {address} ({reason}); "
            "start one with `dask scheduler`, or leave it out"
        ) from error


async def _kind_of(address: str) -> str:
    """What a Dask process at the address says it is; a client would wait for it without end."""
    from distributed.core import connect

    comm = await connect(address, timeout=SCHEDULER_SECONDS)
    try:
        await comm.write({"op": "identity", "reply": True, "close": True})
        return str((await comm.read())["type"])
    finally:
        comm.abort()


def _client(address: str) -> Any:
    from distributed import Client

    try:
        return Client(address, set_as_default=False, timeout=SCHEDULER_SECONDS)
    except (OSError, ValueError) as error:  # TimeoutError is an OSError
        raise UserError(
            f"engine.address: no scheduler answers at {address}; start one with `dask scheduler`, or leave it out"
        ) from error
