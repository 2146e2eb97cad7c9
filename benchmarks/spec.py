"""Speed of robustness: against sentil, the fastest public evaluator, and as batches, trajectories and windows
grow.

Every ratio compares times of this process, the best of several repeats taken in turn. sentil gets its distances
precomputed and its traces built beforehand; ours computes distances from positions.
"""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import sentil

from tltlrl.logic import Spec, load_spec, parse_spec

SPECS = Path(__file__).parent.parent / "specs"

# eq. 3.3 and eq. 3.6. sentil has no T: a T b is F(a & X F b) with its (strong) X.
REACH_AVOID = "F(G(goal < 0.2)) and G(obstacle_1 > 0.5 and obstacle_2 > 0.4)"
VISIT_IN_ORDER = (
    "F(r < 0.2 and X(F(g < 0.2 and X(F(b < 0.2)))))"
    " and (not (g < 0.2 or b < 0.2) U (r < 0.2)) and (not (b < 0.2) U (g < 0.2))"
    " and G((r < 0.2) -> X(G(not (r < 0.2)))) and G((g < 0.2) -> X(G(not (g < 0.2))))"
    " and G((b < 0.2) -> X(G(not (b < 0.2))))"
    " and G(obstacle_1 > 0.35 and obstacle_2 > 0.4 and obstacle_3 > 0.3)"
)


def walks(count: int, steps: int) -> np.ndarray:
    """Random walks in the plane, (count, steps, 2), as an end-effector makes."""
    generator = np.random.default_rng(0)
    return np.cumsum(generator.normal(size=(count, steps, 2)) * 0.05, axis=1)


def best(*functions: Callable[[], object], rounds: int = 7, seconds: float = 0.05) -> list[float]:
    """The time of a call of each function: the best of several rounds, in turn, of calls that fill `seconds`."""
    times: list[list[float]] = [[] for _ in functions]
    for _ in range(rounds):
        for function, own in zip(functions, times, strict=True):
            calls, start, now = 0, time.perf_counter(), 0.0
            while now < seconds:
                function()
                calls, now = calls + 1, time.perf_counter() - start
            own.append(now / calls)
    return [min(own) for own in times]


def distances(spec: Spec, ee: np.ndarray) -> dict[str, np.ndarray]:
    """sentil's signals: the distances of every trajectory from the spec's goals and obstacles."""
    goal, obstacle = spec.constants["goal"], spec.constants["obstacle"]
    points = {**(goal if isinstance(goal, dict) else {"goal": goal})}
    points |= {f"obstacle_{label}": centre for label, centre in obstacle.items()}
    return {name: np.linalg.norm(ee - point, axis=2) for name, point in points.items()}


def against_sentil(name: str, text: str, count: int, steps: int) -> float:
    """Time of sentil over ours, for the values at the first sample of `count` trajectories."""
    spec, ee = load_spec(SPECS / f"{name}.tltl"), walks(count, steps)
    formula, signals = sentil.parse(text), distances(spec, ee)

    def evaluate() -> list[float]:
        values = []
        for row in range(count):
            trace = sentil.Trace.indexed(steps)
            for signal, array in signals.items():
                trace.add_signal(signal, array[row])
            values.append(formula.robustness(trace))
        return values

    ours, theirs = spec.robustness({"ee": ee}), evaluate()
    # They read X at the last sample as -inf, we as +inf: their value is the smaller one where that decides.
    assert np.all(np.isclose(theirs, ours) | (np.array(theirs) < ours))
    mine, sentils = best(lambda: spec.robustness({"ee": ee}), evaluate)
    return sentils / mine


def growth(text: str, small: tuple[int, int], large: tuple[int, int]) -> float:
    """Time per sample of a large batch over that of a small one: at most about 1 when cost is linear."""
    spec = parse_spec(text)
    batches = [{"x": walks(*shape)[:, :, 0]} for shape in (small, large)]
    few, many = best(*(lambda batch=batch: spec.robustness_over_time(batch) for batch in batches))
    return (many / np.prod(large)) / (few / np.prod(small))


def windows(text: str, narrow: int, wide: int) -> float:
    """Time of a bounded formula with a wide window over that with a narrow one, on (10, 100 000) samples."""
    batch = {"x": walks(10, 100_000)[:, :, 0]}
    specs = [parse_spec(text.replace("w", str(width))) for width in (narrow, wide)]
    short, long = best(*(lambda spec=spec: spec.robustness_over_time(batch) for spec in specs))
    return long / short


def monitoring(name: str, count: int, steps: int) -> float:
    """Microseconds of CPU time per step and trajectory of a monitor of `count` trajectories, the median of 15."""
    spec = load_spec(SPECS / f"{name}.tltl")
    ee = np.ascontiguousarray(walks(count, steps).swapaxes(0, 1))
    monitor, rounds = spec.monitor(count), []
    for _ in range(15):
        start = time.process_time()
        monitor.restart()
        for sample in ee:
            monitor.update({"ee": sample})
        rounds.append(time.process_time() - start)
    return float(np.median(rounds)) / count / steps * 1e6


def rows() -> list[tuple[str, float, float | None, str]]:
    """Name, measured value, target, and how the two compare (`>=` or `<=`)."""
    unbounded = "G (x < 1 => F (x > 0)) & ((x < 1) U (x > 2)) & ((x > 1) T (x < 0))"
    bounded = "G[0,50] F[0,100] (x > 0) & ((x < 1) U[5,60] (x > 2))"
    past = "G (x < 1 => once (x > 0)) & ((x < 1) since (x > 2)) & historically rise(x > 1) & x - previous(x) < 1"
    bounded_past = "historically[0,50] once[0,100] (x > 0) & ((x < 1) since[5,60] (x > 2)) & ((x < 1) T[5,60] (x > 2))"
    found: list[tuple[str, float, float | None, str]] = [
        (
            "reach_avoid (30, 200): sentil / ours",
            against_sentil("reach_avoid", REACH_AVOID, 30, 200),
            20.0,
            ">=",
        ),
        (
            "visit_in_order (30, 500): sentil / ours",
            against_sentil("visit_in_order", VISIT_IN_ORDER, 30, 500),
            15.0,
            ">=",
        ),
        (
            "monitor, visit_in_order, N = 20: us of CPU per step and trajectory",
            monitoring("visit_in_order", 20, 200),
            5.0,
            "<=",
        ),
        (
            "visit_in_order (1000, 500): sentil / ours",
            against_sentil("visit_in_order", VISIT_IN_ORDER, 1000, 500),
            20.0,
            ">=",
        ),
    ]
    kinds = {"unbounded": unbounded, "bounded": bounded, "past": past, "bounded past and T": bounded_past}
    for kind, text in kinds.items():
        for steps in (1_000, 10_000, 100_000):
            ratio = growth(text, (10, 100), (10, steps))
            found.append((f"{kind}, N = 10: time per sample, T = {steps} / T = 100", ratio, 2.0, "<="))
        for count in (10, 100, 1_000, 10_000):
            ratio = growth(text, (1, 200), (count, 200))
            found.append((f"{kind}, T = 200: time per sample, N = {count} / N = 1", ratio, 2.0, "<="))
    for width in (100, 1_000, 10_000, 90_000):
        ratio = windows("F[0,w] (x > 0)", 10, width)
        found.append((f"window of {width} steps / of 10", ratio, None, "<="))
    return found
