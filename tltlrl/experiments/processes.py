"""Runs in processes of this machine: each has one run at a time and a pipe to this process, which nobody else can open.

Not `concurrent.futures`: its pool is broken as a whole by one killed worker and does not say whose run that was; and
not a Dask cluster of this machine, which listens on ports that every user of it may connect to.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING

from tltlrl.errors import UserError
from tltlrl.experiments.seldom import seldom

if TYPE_CHECKING:
    from tltlrl.training.study import Run

MOST_DEATHS = 4  # of workers with the same run, after which the run is given up
DESCRIPTORS = 3  # per worker, in this process: the pipe's end, and the two by which each sees the other's end


class WorkerDiedError(Exception):
    """The processes that computed a run died, again and again."""


@dataclass
class _Worker:
    """A worker process and the run that it computes.

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
      compute: called in a worker with a run, its folder and a function for the number of finished iterations. It must
        be a function of a module, which the worker imports.
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
            with contextlib.suppress(OSError):  # it has died, which is noticed when its pipe is read
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
    finally:  # workers are killed even within an iteration: their checkpoints hold what is done
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
    """Leaves Ctrl-C, which reaches the whole process group, to this process: processes started within ignore it.

    Here Ctrl-C waits until the context ends. To block the signal in this thread is not enough: another thread may get
    it, and the exception would come between a worker's start and the first data that the worker reads.
    """
    if sys.platform != "win32":
        resource_tracker.ensure_running()  # starting it unblocks the signal, so it has to be started before
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
    """The work of a worker: computes the runs from the pipe, until its other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Windows has no blocked signals that a process could inherit
    threading.Thread(target=_end_with_the_command, daemon=True).start()
    gc.disable()  # while modules are imported: what they make is no garbage
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
            gc.enable()
        failure: Exception | None = None
        try:
            compute(run, folder, seldom(lambda iteration: pipe.send(("iteration", iteration))))
        except Exception as error:
            failure = _sendable(error)
        pipe.send(("end", failure))


def _end_with_the_command() -> None:
    """Ends this worker when the command ends, however it ends: otherwise it would keep its run's folder locked."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _sendable(error: Exception) -> Exception:
    """The error, or one with the same message if it cannot be sent through a pipe."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
