"""tltl-run that is killed, or whose worker is, at a chosen moment: before a step on its files, in it, or in computing.

Run as a script, it is `tltl-run` under the conditions of the environment variable TLTL_KILLED, a JSON object with
"who" dies ("command" or "worker"), at which "moment" (its number; none: the moments are only listed), and the "notes"
folder. As a script of its own, and not a function, for multiprocessing imports it in the worker processes, too.

Between two steps the files on disk do not change: who dies before each step, and in the middle of each write, has
died in every state that a kill -9 can leave.
"""

import builtins
import io
import json
import os
import signal
import sys
from pathlib import Path

STEPS = {"open": "open", "os.rename": "rename", "os.remove": "delete", "os.mkdir": "make", "os.rmdir": "delete"}


def install(who, moment, notes, role):
    """From now on every step of this process has a number; at number `moment`, if it is `who`, it kills itself."""
    listed = open(Path(notes) / f"{role}.{os.getpid()}", "w", buffering=1)  # noqa: SIM115  # as long as the process
    count = 0

    def step(what, path, half=None):
        nonlocal count
        path = str(path)
        if "runs" not in Path(path).parts or path.endswith(".lock"):
            return
        listed.write(f"{what} {path.partition('runs/')[2].replace(str(os.getpid()), 'PID')}\n")
        if role == who and count == moment:
            try:
                os.close(os.open(Path(notes) / "killed", os.O_CREAT | os.O_EXCL))  # one of the workers, and once
            except FileExistsError:
                pass
            else:
                if half is not None:
                    half()
                os.kill(os.getpid(), signal.SIGKILL)
        count += 1

    def audit(event, arguments):
        if event == "open":
            path, _, flags = arguments
            if isinstance(path, (str, os.PathLike)) and flags & (os.O_WRONLY | os.O_RDWR):
                step("open", path)
        elif event in STEPS:
            step(STEPS[event], arguments[0])

    class Halved(io.FileIO):
        """A file each of whose writes is a step that can be stopped in the middle."""

        def write(self, data):
            step("write", self.name, lambda: super(Halved, self).write(bytes(data)[: len(data) // 2]))
            return super().write(data)

    original = builtins.open

    def opened(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, **rest):
        if "runs" not in Path(str(file)).parts or "+" in mode or not set(mode) & set("wax"):
            return original(file, mode, buffering, encoding, errors, newline, **rest)
        buffer = io.BufferedWriter(Halved(file, mode.replace("b", "").replace("t", "")))
        return buffer if "b" in mode else io.TextIOWrapper(buffer, encoding or "utf-8", errors, newline)

    from tltlrl.training import session as training

    training.CHECKPOINT_SECONDS = 0.0  # a checkpoint after every iteration
    iterate = training.iterate

    def stepwise(run, *rest):
        step("compute", "runs/iteration")
        return iterate(run, *rest)

    training.iterate = stepwise
    builtins.open = io.open = opened
    sys.addaudithook(audit)


if "TLTL_KILLED" in os.environ and __name__ in ("__main__", "__mp_main__"):
    install(**json.loads(os.environ["TLTL_KILLED"]), role="command" if __name__ == "__main__" else "worker")
    if __name__ == "__main__":
        from tltlrl.cli.main import run

        sys.exit(run(sys.argv[1:]))
