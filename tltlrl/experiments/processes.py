"""Runs in processes of this machine: each has one run at a time and a pipe to this process, which nobody else can open.

Not `concurrent.futures`: its pool is broken as a whole by one killed worker and does not say whose run that was; and
not a Dask cluster of this machine, which listens on ports that every user of it may connect to.
"""

from __future__ import annotations

import contextlib
import errno
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

from tltlrl.errors import UserError

if TYPE_CHECKING:
    from tltlrl.training.study import Run

MOST_DEATHS = 4  # of workers over one run, which is given up then
REPORT_SECONDS = 0.5
DESCRIPTORS = 3  # per worker, in this process: the pipe's end, and the two by which each sees the other's end


class WorkerDiedError(Exception):
    """The processes that computed a run died, again and again."""


@dataclass
class _Worker:
    """A process and the run that it is at.

    Attributes:
      process, pipe: of the worker.
      ready: whether it could be started at all.
      job: index of its run; None before the first one and when all are given away.
    """

    process: BaseProcess
    pipe: Connection
    ready: bool = False
    job: int | None = None


def run_in_processes(
    compute: Callable[[Run, Path, Callable[[int], None]], None],
    jobs: list[tuple[Run, Path]],
    workers: int,
    on_progress: Callable[[int, int], None],
    on_end: Callable[[int, Exception | None], None],
) -> None:
    """Computes every job; the run of a worker that dies is given to a new one, which goes on from its checkpoint.

    Args:
      compute: called in a worker with a run, its folder and what is to be told of finished iterations; a function of a
        module, which the worker imports.
      jobs: runs and their folders.
      workers: processes.
      on_progress: called with (index of the job, iterations done).
      on_end: called with (index of the job, its error).

    Raises:
      UserError: if no worker can be started.
      KeyboardInterrupt: on Ctrl-C. Whatever is raised, here or by `on_end`, the workers are killed first.
    """
    waiting, deaths = deque(range(len(jobs))), [0] * len(jobs)
    pool: dict[Connection, _Worker] = {}

    def give(worker: _Worker) -> None:
        worker.job = waiting.popleft() if waiting else None
        if worker.job is not None:
            with contextlib.suppress(OSError):  # it has died, which is noticed when it is read from
                worker.pipe.send((compute, *jobs[worker.job]))

    def died(worker: _Worker) -> None:
        del pool[worker.pipe]
        worker.pipe.close()
        worker.process.join()
        code, index = worker.process.exitcode, worker.job
        if not worker.ready and code is not None and code >= 0:
            raise UserError(f"a worker process could not be started (exit code {code}); set workers=1 to see why")
        if index is not None:
            deaths[index] += 1
            if deaths[index] < MOST_DEATHS:
                waiting.appendleft(index)
            else:
                how = f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
                on_end(index, WorkerDiedError(f"its worker died {MOST_DEATHS} times, the last time with {how}"))
        if waiting:
            worker = _start(workers)
            pool[worker.pipe] = worker
            give(worker)

    try:
        for _ in range(min(workers, len(jobs))):
            worker = _start(workers)
            pool[worker.pipe] = worker
            give(worker)
        while any(worker.job is not None for worker in pool.values()):
            for pipe in wait(list(pool)):
                worker = pool[pipe]  # type: ignore[index]
                try:
                    kind, content = worker.pipe.recv()
                except (EOFError, OSError):
                    died(worker)
                    continue
                if kind == "ready":
                    worker.ready = True
                elif kind == "unable":
                    raise UserError(f"a worker process could not be started: {content}")
                elif kind == "iteration" and worker.job is not None:
                    on_progress(worker.job, content)
                elif worker.job is not None:
                    on_end(worker.job, content)
                    give(worker)
    finally:  # nobody waits for workers in the middle of an iteration, and those without a run have nothing to lose
        for worker in pool.values():
            worker.process.kill()
        for worker in pool.values():
            worker.process.join()


def _start(workers: int) -> _Worker:
    """A new worker process.

    Raises:
      UserError: if the system gives no more processes or descriptors.
    """
    context = multiprocessing.get_context("spawn")
    try:
        ours, its = context.Pipe()
        process = context.Process(target=_work, args=(its,), daemon=True)
        with _without_interrupt():
            process.start()
        its.close()
    except OSError as error:
        if error.errno == errno.EMFILE:
            raise UserError(
                f"workers={workers}: there are not enough file descriptors for so many (about {DESCRIPTORS} each); "
                "set fewer, or raise the limit with ulimit -n"
            ) from error
        raise UserError(f"workers={workers}: no process can be started ({error.strerror}); set fewer") from error
    return _Worker(process, ours)


@contextlib.contextmanager
def _without_interrupt() -> Iterator[None]:
    """What is started here leaves Ctrl-C, which reaches the whole process group, to this process.

    And here it waits for the end: blocked in this thread, the signal may still reach another one, and its exception
    would come between a worker's start and what the worker reads first.
    """
    if sys.platform != "win32":
        resource_tracker.ensure_running()  # starting it unblocks the signal, so that comes first
    handler, interrupted = signal.getsignal(signal.SIGINT), False

    def remember(*_: object) -> None:
        nonlocal interrupted
        interrupted = True

    deferred = callable(handler) and threading.current_thread() is threading.main_thread()
    if deferred:
        signal.signal(signal.SIGINT, remember)
    if sys.platform != "win32":
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if sys.platform != "win32":
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if deferred:
            signal.signal(signal.SIGINT, handler)
    if interrupted:
        raise KeyboardInterrupt


def _work(pipe: Connection) -> None:
    """What a worker does: computes the runs that come out of the pipe, until there is nobody at its other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Windows has no blocked signals that a process could inherit
    threading.Thread(target=_end_with_the_command, daemon=True).start()
    ready = False
    while True:
        try:
            compute, run, folder = pipe.recv()  # the first time it imports what it needs
        except EOFError:
            return
        except Exception as error:  # above all for want of memory
            pipe.send(("unable", f"{type(error).__name__}: {error}"))
            return
        if not ready:
            pipe.send(("ready", None))
            ready = True
        last = 0.0

        def report(iteration: int) -> None:
            nonlocal last
            if time.monotonic() - last > REPORT_SECONDS:
                last = time.monotonic()
                pipe.send(("iteration", iteration))

        failure: Exception | None = None
        try:
            compute(run, folder, report)
        except Exception as error:
            failure = _sendable(error)
        pipe.send(("end", failure))


def _end_with_the_command() -> None:
    """However that ends: a worker that went on would hold its run's folder."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _sendable(error: Exception) -> Exception:
    """The error, or one that says the same if it cannot go through a pipe."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
