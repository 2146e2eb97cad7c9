"""Whether a monitor is exact: every prefix of random trajectories under random formulas, against whole evaluations.

Formulas and promises are those of tests/logic (strategies.py, online/test_monitor.py),
the formulas larger and more of them.

    python -m studies.monitor --formulas 10000
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, given, seed, settings

from tltlrl.logic import parse_spec

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "logic"))
sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "logic" / "online"))
from strategies import formulas
from test_monitor import DECLARED, check, samples, seeds


def main(arguments: list[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser("python -m studies.monitor", description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--formulas", type=int, default=10_000)
    parser.add_argument("--leaves", type=int, default=6, help="the most predicates in one formula")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args(arguments)
    slow: list[bool] = []
    states: list[int] = []
    seconds: list[float] = []

    @seed(chosen.seed)
    @settings(deadline=None, max_examples=chosen.formulas, database=None, suppress_health_check=list(HealthCheck))
    @given(formulas(chosen.leaves), seeds)
    def exact(formula: Any, drawn: int) -> None:
        spec, start = parse_spec(DECLARED + str(formula)), time.perf_counter()
        reading = spec.monitor().update(dict.fromkeys(spec.signals, 0.0))
        seconds.append(time.perf_counter() - start)
        slow.append(check(spec, samples(drawn)).keeps_past)
        states.append(0 if reading.state is None else reading.state.shape[1])

    exact()
    half = sorted(states)[len(states) // 2]
    print(
        f"{len(slow)} formulas, 3 trajectories of 8 samples each: equal at every prefix, within the bounds; "
        f"{sum(slow)} keep their past; numbers in a state: at most {max(states)}, half have {half} or fewer; "
        f"made ready in {max(seconds):.3f} s at most"
    )


if __name__ == "__main__":
    main()
