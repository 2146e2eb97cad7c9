"""Computes runs in this process, in processes of this machine, or on a running Dask scheduler.

All three call the same `train` on the same folders, so all three write the same bytes. If a worker dies, another one
resumes its run from the checkpoint.
"""

from __future__ import annotations

import os
from collections.abc import Callable

from tltlrl.experiments.origin import machine
from tltlrl.experiments.processes import run_in_processes
from tltlrl.experiments.scheduler import Job, OnEnd, OnProgress, run_on_scheduler
from tltlrl.training.session import train

# Of the processes of this machine, which inherit it: runs are what is parallel.
ENVIRONMENT = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_all(
    jobs: list[Job],
    workers: int,
    address: str | None,
    on_progress: OnProgress,
    on_end: OnEnd,
    say: Callable[[str], None],
) -> None:
    """Computes every job. A job that fails is reported through `on_end`, and the others go on.

    Args:
      jobs: runs and their folders.
      workers: processes of this machine; 1 computes in this process. Ignored with an address.
      address: of a Dask scheduler whose workers see the same files.
      on_progress, on_end: called in this process; `on_end` with the machine that computed the run.
      say: called with messages for the user, such as what the command waits for.

    Raises:
      UserError: if the scheduler cannot be reached, or no process can be started.
      KeyboardInterrupt: on Ctrl-C, after the workers of this machine were stopped.
    """
    if address is None and workers == 1:
        for index, (run, folder) in enumerate(jobs):
            try:
                train(run, folder, lambda iteration, index=index: on_progress(index, iteration))  # type: ignore[misc]
            except Exception as error:
                on_end(index, error, machine())
            else:
                on_end(index, None, machine())
        return

    if address is None:
        for name, value in ENVIRONMENT.items():
            os.environ.setdefault(name, value)
        run_in_processes(train, jobs, workers, on_progress, lambda index, error: on_end(index, error, machine()))
        return

    run_on_scheduler(address, jobs, on_progress, on_end, say)
