"""Progress that a worker reports not after every iteration, but twice a second."""

import time
from collections.abc import Callable

REPORT_SECONDS = 0.5


def seldom(report: Callable[[int], None]) -> Callable[[int], None]:
    """A function that calls `report` only if its last call was `REPORT_SECONDS` ago."""
    last = 0.0

    def reported(iteration: int) -> None:
        nonlocal last
        if time.monotonic() - last > REPORT_SECONDS:
            last = time.monotonic()
            report(iteration)

    return reported
