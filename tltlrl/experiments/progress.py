"""How far a long job is: a bar on a terminal, plain lines elsewhere, and a log file in the experiment's folder."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

LINE_SECONDS = 30.0
BAR_SECONDS = 1.0


class Progress:
    """Counts iterations over all runs and says what is done and what time is left."""

    def __init__(
        self,
        labels: list[str],
        iterations: int,
        log: Path,
        robustness: Callable[[int], float | None] = lambda _: None,
        stream: TextIO | None = None,
    ) -> None:
        self._labels = labels
        self._robustness = robustness  # of a run so far, by its index
        self._iterations = iterations
        self._done = [0] * len(labels)
        self._ended = 0
        self._failed = 0
        self._start = self._last_line = time.monotonic()
        self._earlier = [0] * len(labels)  # iterations of an earlier session, which say nothing of the speed
        stream = stream or sys.stderr
        self._stream: TextIO | None = stream
        self._log = open(log, "a", encoding="utf-8")  # noqa: SIM115  # closed by __exit__
        self._bar: Any = tqdm(
            total=len(labels) * iterations, unit="it", file=stream, disable=not stream.isatty(), dynamic_ncols=True
        )

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()
        self._log.close()

    def say(self, line: str) -> None:
        """One line on the terminal and, with the time of day, in the log file."""
        print(time.strftime("%Y-%m-%d %H:%M:%S"), line, file=self._log, flush=True)
        if not self._bar.disable:
            self._bar.write(line, file=self._stream)
        elif self._stream is not None:
            try:
                print(line, file=self._stream, flush=True)
            except BrokenPipeError:  # whoever read it has seen enough; the runs go on, and the log has every line
                self._stream = None

    def advance(self, index: int, iteration: int) -> None:
        """Run `index` has done `iteration` iterations."""
        if self._done[index] == 0:
            self._earlier[index] = iteration - 1
        self._done[index] = iteration
        self._bar.update(sum(self._done) - self._bar.n)
        if time.monotonic() - self._last_line > (LINE_SECONDS if self._bar.disable else BAR_SECONDS):
            self._last_line = time.monotonic()
            robustness = self._robustness(index)
            so_far = "" if robustness is None else f", robustness {robustness:+.3f}"
            if self._bar.disable:
                self.say(f"{self._state()}; {self._labels[index]} at iteration {iteration}/{self._iterations}{so_far}")
            else:
                self._bar.set_postfix_str(f"{self._labels[index]}{so_far}")

    def end(self, index: int, error: Exception | None) -> None:
        """Run `index` has ended."""
        self._ended += 1
        if error is None:
            self._done[index] = self._iterations
            self._bar.update(sum(self._done) - self._bar.n)
            self.say(f"{self._state()}; {self._labels[index]} finished")
        else:
            self._failed += 1
            self.say(f"{self._state()}; {self._labels[index]} FAILED: {type(error).__name__}: {error}")

    def _state(self) -> str:
        done = sum(self._done) - sum(self._earlier)
        remaining = len(self._labels) * self._iterations - sum(self._done)
        elapsed = time.monotonic() - self._start
        left = f", {_duration(elapsed / done * remaining)} left" if done and remaining else ""
        failed = f", {self._failed} failed" if self._failed else ""
        return f"{self._ended}/{len(self._labels)} done{failed}{left}"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
