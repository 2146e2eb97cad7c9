"""Which potential step-based REPS learns best from: five candidates, and episode-based REPS beside them.

All have the robustness as their last value. `hope` and `stages` are those of tltlrl.logic.online; `upper` is the
bound without a cut at 0; `ended_now` the robustness if the trajectory ended there; `guards` that, less STAGE for each
guard that has still to be passed but the first, and how far the sample is from that one. Runs are as in `tltl-run`.

    python -m studies.potentials reach_avoid --seeds 4 --output potentials.csv
"""

from __future__ import annotations

import argparse
from functools import partial
from unittest.mock import patch

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.logic import telescope
from tltlrl.logic.online.monitor import Monitor, Reading
from tltlrl.logic.online.potential import Potential, finite, hope, stages
from tltlrl.logic.online.pursuit import Quick
from tltlrl.training import loop
from tltlrl.training.build import set_up
from tltlrl.training.start import first_policy

Array = NDArray[np.float64]
STAGE = 3.0  # in the predicates' unit: what one guard counts in `guards`, and no distance from one counts more


def ended_now(monitor: Monitor, reading: Reading) -> Array:
    """The robustness, cut where it is infinite."""
    del monitor
    return finite(reading.robustness)


def upper(_: Monitor, reading: Reading) -> Array:
    """The most that can still become of it, cut where that is infinite."""
    return finite(reading.upper)


def guards(monitor: Monitor, reading: Reading) -> Array:
    """The robustness and, of each conjunct, what its best state is worth."""
    phi = finite(reading.robustness)
    literals = monitor.literals
    for pursuit in monitor.pursuits:
        if not isinstance(pursuit, Quick):
            continue
        row = {literal: i for i, literal in monitor.atom_rows().items()}
        for offset, one in zip(pursuit.together.offsets, pursuit.together.automata, strict=True):
            far = one.distances()
            best = np.full(monitor.count, -np.inf)
            for state, d in enumerate(far):
                worth = np.minimum(pursuit.alpha[offset + state].clip(-10, 0), 0.0)
                if d > 0:
                    leads = [guard for a, guard, b in one.transitions if a == state and far[b] < d]
                    onward = [
                        np.min([literals[row[i]] for i in guard], axis=0) for guard in leads if guard <= row.keys()
                    ]
                    near = np.max(onward, axis=0) if onward else np.zeros(monitor.count)
                    worth = worth - (d - 1) * STAGE + (near / 3.0).clip(-STAGE, 0.0)
                best = np.maximum(best, worth)
            phi = phi + np.minimum(best, 0.0)
    return phi


CANDIDATES: dict[str, Potential] = {
    "hope": hope,
    "stages": stages,
    "upper": upper,
    "ended_now": ended_now,
    "guards": guards,
}


def learn(experiment: str, name: str, seed: int, iterations: int) -> list[float]:
    """The robustness of the mean policy after each iteration, the last one of the policy that is left."""
    case = "tltl_step" if name in CANDIDATES else name
    study, _ = read(compose([f"experiment={experiment}", f"cases=[{case}]", f"seeds=[{seed}]"]))
    (run,) = study.runs()
    setup = set_up(run)
    state = setup.learner.start(first_policy(setup.task, run.algorithm))
    found = []
    with patch.object(loop, "telescope", partial(telescope, phi=CANDIDATES.get(name, hope))):
        for iteration in range(iterations):
            done = loop.iterate(run, setup, state, iteration)
            state = done.state
            found.append(done.record["robustness_policy"])
    return found


def main(arguments: list[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser("python -m studies.potentials")
    parser.add_argument("experiment")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--iterations", type=int, default=200)
    parser.add_argument("--cases", nargs="+", default=["tltl_episodic", *CANDIDATES])
    parser.add_argument("--output", required=True, help="a .csv file: one row per case, seed and iteration")
    chosen = parser.parse_args(arguments)
    rows = []
    for name in chosen.cases:
        for seed in range(chosen.seeds):
            curve = learn(chosen.experiment, name, seed, chosen.iterations)
            rows += [(chosen.experiment, name, seed, i, value) for i, value in enumerate(curve)]
            satisfied = np.flatnonzero(np.array(curve) > 0)
            first = satisfied[0] if len(satisfied) else "never"
            print(f"{name:14} seed {seed}: first satisfied {first}, final {curve[-1]:+.4f}", flush=True)
        columns = ["experiment", "case", "seed", "iteration", "robustness_policy"]
        pd.DataFrame(rows, columns=columns).to_csv(chosen.output, index=False)


if __name__ == "__main__":
    main()
