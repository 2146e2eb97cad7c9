"""Runs on the workers of a Dask scheduler of the user's: who answers there, who may compute, who is waited for.

A worker with other code or other versions than the command's would give other numbers, unnoticed. So every job names
the code and the versions that it needs, and a worker with others refuses it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
import urllib.parse
import uuid
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tltlrl.errors import UserError, printable
from tltlrl.experiments.origin import different, machine, origin
from tltlrl.experiments.seldom import seldom
from tltlrl.training.session import train
from tltlrl.training.study import Run

SCHEDULER_SECONDS = 10
CLOSE_SECONDS = 1
LOOK_SECONDS = 0.05
SILENCE_SECONDS = 5.0  # after which it is told what is waited for,
AGAIN_SECONDS = 60.0  # and again
AHEAD = 2  # jobs per thread of the workers: while one is computed, the next one is there

Job = tuple[Run, Path]
OnProgress = Callable[[int, int], None]  # (index of the job, iterations done)
OnEnd = Callable[[int, Exception | None, str], None]  # (index of the job, its error, who computed it)


@dataclass(frozen=True)
class Answer:
    """What a worker says of a job.

    Attributes:
      worker: its address.
      machine: its host and processor.
      refusal: why it computed nothing; empty if it did.
      error: the error of the run. It is returned, because Dask would log a raised one as the worker's fault.
    """

    worker: str
    machine: str
    refusal: str = ""
    error: Exception | None = None


def run_on_scheduler(
    address: str, jobs: list[Job], on_progress: OnProgress, on_end: OnEnd, say: Callable[[str], None]
) -> None:
    """Computes every job on the scheduler's workers, as they come and go.

    Args:
      address: of the scheduler.
      jobs: runs and their folders, which the workers see, too.
      on_progress, on_end: called in this process.
      say: told what is waited for, and which worker refuses.

    Raises:
      UserError: if the scheduler cannot be reached or is lost, or all of its workers refuse.
    """
    client = _client(address)
    begun: set[int] = set()
    topic = f"tltlrl-{uuid.uuid4()}"  # another command may use the same scheduler

    def hear(event: tuple[Any, tuple[int, int | None]]) -> None:
        index, iteration = event[1]
        begun.add(index)
        if iteration is not None:
            on_progress(index, iteration)

    try:
        client.subscribe_topic(topic, hear)
        _compute(client, address, topic, jobs, begun, on_end, say)
    except OSError as error:  # of a call to the scheduler; those of runs are results
        if error.filename is not None:
            raise
        raise _gone(address) from error
    finally:
        with contextlib.suppress(TimeoutError, OSError):  # Ctrl-C waits for nobody; runs under way end by themselves
            client.close(timeout=CLOSE_SECONDS)


def _compute(
    client: Any,
    address: str,
    topic: str,
    jobs: list[Job],
    begun: set[int],
    on_end: OnEnd,
    say: Callable[[str], None],
) -> None:
    """Gives the scheduler no more jobs than its workers will begin soon: thousands take it seconds to forget."""
    from distributed import as_completed

    waiting = deque(enumerate(jobs))
    futures: dict[Any, int] = {}  # => index of the job
    refusals: dict[str, str] = {}  # address of a worker => what it differs in
    ended = as_completed(loop=client.loop)

    def give() -> None:
        threads = client.nthreads()  # workers come and go
        willing = [worker for worker in threads if worker not in refusals]
        if refusals and not willing:
            raise UserError(
                f"engine.address: no worker of {address} has what this command has; give all of them the same "
                "environment and the same version of tltlrl, and start the same command again"
            )
        while waiting and len(futures) < AHEAD * max(1, sum(threads[worker] for worker in willing)):
            index, (run, folder) = waiting.popleft()
            asked = origin(run.task.name, run.case.learner)
            future = client.submit(
                _on_worker, topic, index, run, folder, asked, pure=False, workers=willing if refusals else None
            )
            futures[future] = index
            ended.add(future)

    def end(future: Any) -> None:
        index = futures.pop(future)
        if future.status in ("cancelled", "lost"):
            raise _gone(address)
        answer = future.result() if future.status == "finished" else None
        if answer is None:
            on_end(index, _told(future.exception()), "")
        elif not answer.refusal:
            on_end(index, answer.error, answer.machine)
        else:
            waiting.appendleft((index, jobs[index]))
            begun.discard(index)
            if answer.worker not in refusals:
                say(f"the worker at {answer.worker}, {answer.machine}, computes nothing: {answer.refusal}")
            refusals[answer.worker] = answer.refusal

    patience = _Patience(client, address, begun, futures, say)
    give()
    while futures:
        if ended.has_ready():
            end(next(ended))
            give()
        else:
            patience.look()
            time.sleep(LOOK_SECONDS)


class _Patience:
    """Says what is waited for, while no worker computes."""

    def __init__(
        self, client: Any, address: str, begun: set[int], futures: Mapping[Any, int], say: Callable[[str], None]
    ) -> None:
        self._client, self._address, self._say = client, address, say
        self._begun, self._futures = begun, futures
        self._tell = time.monotonic() + SILENCE_SECONDS  # when there will be something to tell

    def look(self) -> None:
        """To be called again and again.

        Raises:
          UserError: if the scheduler is gone.
        """
        if self._client.status != "running":
            raise _gone(self._address)
        if time.monotonic() < self._tell:
            return
        workers = self._client.nthreads()
        under_way = bool(self._begun & set(self._futures.values()))
        if workers and under_way:
            self._tell = time.monotonic() + SILENCE_SECONDS
            return
        self._tell = time.monotonic() + AGAIN_SECONDS
        if not workers:
            self._say(
                f"no worker is connected to the scheduler at {self._address}; start one, as with `dask worker "
                f"{self._address} --nthreads 1`; waiting for it"
            )
        else:
            self._say(
                f"none of the {len(workers)} workers of {self._address} has begun a run: they are at other work, or "
                f"cannot begin one{self._versions()}; waiting for them"
            )

    def _versions(self) -> str:
        """The workers whose Python or Dask are others than here, or who do not even say it."""
        try:
            found = self._client.sync(self._client.get_versions, callback_timeout=SILENCE_SECONDS)
        except (OSError, TypeError):
            return " (they do not say their versions)"
        here = _dask_of(found["client"])
        told = [
            f"{worker}: {differs}"
            for worker in self._client.nthreads()
            if (differs := different(here, _dask_of(found["workers"].get(worker))))
        ]
        return f" ({'; '.join(told[:3])}{'; ...' if len(told) > 3 else ''})" if told else ""


def _dask_of(versions: Any) -> dict[str, str]:
    packages = versions["packages"] if isinstance(versions, Mapping) else {}
    return {name: str(packages[name]) for name in ("python", "distributed", "dask") if name in packages}


def _gone(address: str) -> UserError:
    return UserError(
        f"engine.address: the scheduler at {address} is gone; start it and its workers, and the same command again: "
        "what is done is kept"
    )


def _told(error: Exception) -> Exception:
    """A worker that has no tltlrl, or one without this module, cannot say so itself."""
    if isinstance(error, ImportError | AttributeError):
        return UserError(f"its worker has another version of tltlrl, or none ({printable(error, 200)})")
    return error


def _on_worker(topic: str, index: int, run: Run, folder: Path, asked: Mapping[str, str]) -> Answer:
    from distributed import get_worker

    worker = get_worker()
    if differs := different(asked, origin(run.task.name, run.case.learner)):
        return Answer(worker.address, machine(), refusal=differs)
    worker.log_event(topic, (index, None))
    try:
        train(run, folder, seldom(lambda iteration: worker.log_event(topic, (index, iteration))))
    except Exception as error:
        return Answer(worker.address, machine(), error=error)
    return Answer(worker.address, machine())


def check_scheduler(address: str) -> None:
    """Whether a scheduler answers at the address, before a folder is made for its results.

    Raises:
      UserError: if not.
    """
    parts = urllib.parse.urlsplit(address)
    try:
        if parts.scheme not in ("tcp", "tls") or parts.port is None:
            raise ValueError("it must be tcp://HOST:PORT or tls://HOST:PORT")
        certificates = _certificates() if parts.scheme == "tls" else {}
        socket.create_connection((parts.hostname or "", parts.port), timeout=SCHEDULER_SECONDS).close()
        kind = asyncio.run(asyncio.wait_for(_kind_of(address, certificates), SCHEDULER_SECONDS))
        if kind != "Scheduler":
            raise ValueError(f"there is a {kind}")
    except UserError:
        raise
    except Exception as error:  # whoever answers may answer anything
        reason = printable(error, 200) or f"no answer within {SCHEDULER_SECONDS} s"
        raise UserError(
            f"engine.address: no scheduler answers at {address} ({reason}); "
            "start one with `dask scheduler`, or leave it out"
        ) from error


def _certificates() -> dict[str, Any]:
    """What a tls:// scheduler is shown, as Dask's own configuration says.

    Raises:
      UserError: if that says nothing.
    """
    from distributed.security import Security

    security = Security()
    for name in ("ca-file", "client.cert", "client.key"):
        if getattr(security, f"tls_{name.replace('-', '_').replace('.', '_')}") is None:
            variable = f"DASK_DISTRIBUTED__COMM__TLS__{name.replace('-', '_').replace('.', '__').upper()}"
            raise UserError(
                f"engine.address: tls:// needs certificates, and Dask is told of none (distributed.comm.tls.{name}); "
                f"set {variable}, or see docs/clusters.md"
            )
    return dict(security.get_connection_args("client"))


async def _kind_of(address: str, certificates: Mapping[str, Any]) -> str:
    """What a Dask process at the address says it is; a client would wait for it without end."""
    from distributed.core import connect

    comm = await connect(address, timeout=SCHEDULER_SECONDS, **certificates)
    try:
        await comm.write({"op": "identity", "reply": True, "close": True})
        return str((await comm.read())["type"])
    finally:
        comm.abort()


def _client(address: str) -> Any:
    from distributed import Client

    for name in list(logging.root.manager.loggerDict):  # a client logs its broken connections, with a traceback each
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        return Client(address, set_as_default=False, timeout=SCHEDULER_SECONDS)
    except (OSError, ValueError, TypeError) as error:  # TimeoutError is an OSError
        raise UserError(
            f"engine.address: no scheduler answers at {address} ({printable(error, 200)}); start one with "
            "`dask scheduler`, or leave it out"
        ) from error
