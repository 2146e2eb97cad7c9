"""Predicates on a wrong scale, with and without `algorithm.normalise`: the toast task.

    python -m studies.normalise --seeds 20 --output studies/normalise.csv

The gripper's predicates of toast.tltl are multiplied by a factor in the spec that is learned from. Whatever was learned
is judged by toast.tltl itself. Prints one line per setting.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.logic import load_spec
from tltlrl.resources import spec_path
from tltlrl.training.build import set_up
from tltlrl.training.learned import learned_policy
from tltlrl.training.session import train
from tltlrl.training.verdict import robustness_of

FACTORS = (1.0, 0.1, 0.01, 1200.0)  # 1200: the gripper in per cent
SCALE = "let kappa = slot_half_width / delta_close"


def variant(factor: float) -> str:
    """toast.tltl with the gripper's scale multiplied.

    Raises:
      ValueError: if the spec no longer has that scale.
    """
    text = spec_path("toast.tltl").read_text(encoding="utf-8")
    if SCALE not in text:
        raise ValueError(f"toast.tltl has no line '{SCALE}'")
    return text.replace(SCALE, f"{SCALE} * {factor!r}")


def judged(
    path: Path, factor: float, normalise: bool, seeds: int, iterations: int, folder: Path
) -> list[dict[str, Any]]:
    """Learns from the spec in `path` with every seed; one row each, judged by toast.tltl."""
    overrides = [f"spec={path}", f"seeds={seeds}", "trials=1", "cases=[tltl_episodic]"]
    settings = [f"algorithm.normalise={str(normalise).lower()}", f"algorithm.iterations={iterations}"]
    study, _ = read(compose(["experiment=toast", *overrides, *settings]))
    meant = load_spec(spec_path("toast.tltl"))
    rows = []
    for run in study.runs():
        place = folder / f"{path.stem}_{normalise}" / str(run.seed)
        place.mkdir(parents=True)
        train(run, place, lambda _: None)
        own = replace(run, spec=meant)
        robustness = robustness_of(own, set_up(own), learned_policy(place))
        rows.append({"factor": factor, "normalise": normalise, "seed": run.seed, "robustness_policy": robustness})
    return rows


def overview(table: pd.DataFrame) -> pd.DataFrame:
    """One row per setting: seeds that satisfy toast.tltl, and the robustness by it."""
    groups = table.groupby(["factor", "normalise"], sort=False).robustness_policy
    return groups.agg(seeds="size", satisfied=lambda r: int((r > 0).sum()), median="median", least="min").reset_index()


def main(arguments: list[str] | None = None) -> int:
    """Learns with every factor, with and without normalised predicates; the table grows as it goes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--iterations", type=int, default=80)
    parser.add_argument("--output", type=Path, required=True, metavar="FILE.csv")
    asked = parser.parse_args(arguments)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for factor in FACTORS:
            path = Path(folder) / f"toast_{factor:g}.tltl"
            path.write_text(variant(factor), encoding="utf-8")
            for normalise in (False, True):
                rows += judged(path, factor, normalise, asked.seeds, asked.iterations, Path(folder))
                table = pd.DataFrame(rows)
                table.to_csv(asked.output, index=False, lineterminator="\n")
                print(overview(table).to_string(index=False), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
