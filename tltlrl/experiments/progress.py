"""Shows how far a long job is: bars on a terminal, otherwise plain lines, and a log file in the folder."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from tltlrl.errors import shown

LINE_SECONDS = 30.0
BAR_SECONDS = 1.0
BAR = "{desc} {percentage:3.0f} % |{bar:8}| {remaining} left{postfix}"
NARROW = "{desc} {remaining} left{postfix}"  # where a bar would push what decides out of the line
WIDE = 110  # columns that a line with a bar needs


class Progress:
    """Counts iterations, and the calm batches after them, over all runs; says what is done and what time is left."""

    def __init__(
        self,
        labels: list[str],
        iterations: int,
        log: Path,
        standing: Callable[[int], str] = lambda _: "",
        stream: TextIO | None = None,
        calm: int = 0,
    ) -> None:
        self._labels = labels
        self._standing = standing  # index of a run => where it stands, in words
        self._iterations = iterations
        self._calm = calm  # batches; a run that violates its spec has none
        self._steps = iterations + calm  # of one run
        self._done = [0] * len(labels)
        self._ended = 0
        self._failed = 0
        self._start = self._last_line = time.monotonic()
        self._case = [label.partition(" seed ")[0] for label in labels]
        cases = list(dict.fromkeys(self._case))
        self._shown = dict.fromkeys(cases, self._start)  # when the bar of each said last where it stands
        self._earlier = [0] * len(labels)  # iterations of an earlier session, which say nothing of the speed
        stream = stream or sys.stderr
        self._stream: TextIO | None = stream
        self._log = open(log, "a", encoding="utf-8")  # noqa: SIM115  # closed by __exit__
        self._on_terminal = stream.isatty()
        width = max(map(len, cases), default=0)
        bar_format = BAR if shutil.get_terminal_size().columns >= WIDE else NARROW
        self._bars: dict[str, Any] = {
            case: tqdm(
                total=self._case.count(case) * self._steps,
                desc=case.ljust(width),
                position=place,
                bar_format=bar_format,
                file=stream,
                disable=not self._on_terminal,
                dynamic_ncols=True,
            )
            for place, case in enumerate(cases)
        }

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        for bar in self._bars.values():
            bar.close()
        self._log.close()

    def say(self, line: str) -> None:
        """Writes one line to the terminal and, with the time of day, to the log file."""
        line = shown(line)
        print(time.strftime("%Y-%m-%d %H:%M:%S"), line, file=self._log, flush=True)
        if self._on_terminal:
            tqdm.write(line, file=self._stream)
        elif self._stream is not None:
            try:
                print(line, file=self._stream, flush=True)
            except OSError:  # the reader is gone, or the disk is full; the runs go on, and the log has every line
                self._stream = None

    def advance(self, index: int, done: int) -> None:
        """Records that run `index` has done so many iterations and calm batches together."""
        if self._done[index] == 0:
            self._earlier[index] = done - 1
        self._done[index] = done
        self._count(index)
        case, now = self._case[index], time.monotonic()
        if self._on_terminal and now - self._shown[case] > BAR_SECONDS:
            self._shown[case] = now
            seed = self._labels[index].removeprefix(case).strip()
            self._bars[case].set_postfix_str(f"{self._place(done, '')}{self._so_far(index)}, {seed}")
        elif not self._on_terminal and now - self._last_line > LINE_SECONDS:
            self._last_line = now
            at = f"{self._labels[index]} at {self._place(done, 'iteration ')}{self._so_far(index)}"
            self.say(f"{self._state()}; {at}")

    def _place(self, done: int, unit: str) -> str:
        if done > self._iterations:
            return f"calm batch {done - self._iterations}/{self._calm}"
        return f"{unit}{done}/{self._iterations}"

    def _so_far(self, index: int) -> str:
        said = self._standing(index)
        return f", {said}" if said else ""

    def _count(self, index: int) -> None:
        """Updates the bar of the run's case."""
        bar = self._bars[self._case[index]]
        done = sum(n for n, case in zip(self._done, self._case, strict=True) if case == self._case[index])
        bar.update(done - bar.n)

    def end(self, index: int, error: Exception | None) -> None:
        """Records that run `index` has ended."""
        self._ended += 1
        if error is None:
            self._done[index] = self._steps
            self._count(index)
            self.say(f"{self._state()}; {self._labels[index]} finished")
        else:
            self._failed += 1
            self.say(f"{self._state()}; {self._labels[index]} FAILED: {type(error).__name__}: {error}")

    def _state(self) -> str:
        done = sum(self._done) - sum(self._earlier)
        remaining = len(self._labels) * self._steps - sum(self._done)
        elapsed = time.monotonic() - self._start
        left = f", {_duration(elapsed / done * remaining)} left" if done and remaining else ""
        failed = f", {self._failed} failed" if self._failed else ""
        return f"{self._ended}/{len(self._labels)} done{failed}{left}"


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
