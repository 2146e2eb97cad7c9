"""The covariance study: what makes REPS converge on both planar tasks; docs/covariance.md has its results.

    python -m studies.covariance run --task reach_avoid --settings published damped --seeds 10
    python -m studies.covariance table

`run` appends one row per seed to studies/covariance.csv, `table` prints the CSV as tables.

Each rule is a function from weighted samples to the next Gaussian of every step. Written for one step, with weights
p_i, samples delta_i, old mean k and covariance S, and k' = sum_i p_i delta_i throughout but for `bounded`.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from studies.lockstep import Array, Fit, Kinematic, Learner, train
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.learning.reps import fit
from tltlrl.registry import LEARNERS
from tltlrl.simulation.rollout import Simulator
from tltlrl.training.build import make_reward, make_task
from tltlrl.training.start import first_policy

RESULTS = Path(__file__).parent / "covariance.csv"
DIMENSIONS = 3  # joint-velocity commands of the planar arm
COMMAND = 2.0  # their full size, rad/s
OVERVIEW_SEEDS = 10  # 0 .. 9, those that every setting of the overview was run on

published: Fit = functools.partial(fit, rule="published", kept=0.0)
"""S' = sum_i p_i (delta_i - k') (delta_i - k')^T"""


def damped(kept: float) -> Fit:
    """S' = kept S + (1 - kept) diag sum_i p_i (delta_i - k)^2, about the old mean k."""
    return functools.partial(fit, rule="damped", kept=kept)


def damped_about_new(kept: float) -> Fit:
    """S' = kept S + (1 - kept) diag sum_i p_i (delta_i - k')^2 / (1 - sum_i p_i^2), about the new mean, unbiased."""

    def rule(offsets: Array, weights: Array, mean: Array, covariance: Array) -> tuple[Array, Array]:
        new, fitted = published(offsets, weights, mean, covariance)
        unbiased = fitted / (1 - np.sum(weights**2, axis=1))[:, None, None]
        return new, kept * covariance + (1 - kept) * unbiased * np.eye(DIMENSIONS)

    return rule


def bounded(bound: float) -> Fit:
    """The weighted maximum likelihood under KL(old || new) <= bound (nats per step), diagonal.

    With the fitted (m, F) its Lagrangian is solved by the moments of a mixture of fit and old Gaussian,
    k' = a m + (1 - a) k and S' = a F + (1 - a) S + a (1 - a) diag (m - k)^2; the largest such a in [0, 1] is sought by
    bisection, all steps at once.
    """

    def rule(offsets: Array, weights: Array, mean: Array, covariance: Array) -> tuple[Array, Array]:
        fitted_mean, fitted = published(offsets, weights, mean, covariance)
        old, target = np.diagonal(covariance, axis1=1, axis2=2), np.diagonal(fitted, axis1=1, axis2=2)
        square = (fitted_mean - mean) ** 2

        def variance(a: Array) -> Array:
            return a * target + (1 - a) * old + a * (1 - a) * square

        low, high = np.zeros((len(mean), 1)), np.ones((len(mean), 1))
        for _ in range(20):
            a = 0.5 * (low + high)
            new = variance(a)
            kl = 0.5 * np.sum((old + a**2 * square) / new - 1 + np.log(new / old), axis=1, keepdims=True)
            low, high = np.where(kl <= bound, a, low), np.where(kl <= bound, high, a)
        return low * fitted_mean + (1 - low) * mean, variance(low)[:, :, None] * np.eye(DIMENSIONS)

    return rule


def shared(offsets: Array, weights: Array, mean: Array, covariance: Array) -> tuple[Array, Array]:
    """S' = mean over the steps of the published S'_t: one covariance for the whole trajectory."""
    new, fitted = published(offsets, weights, mean, covariance)
    return new, np.broadcast_to(fitted.mean(axis=0), fitted.shape).copy()


def floored(share: float) -> Fit:
    """The published S' with every eigenvalue raised to at least (share x a full command)^2."""

    def rule(offsets: Array, weights: Array, mean: Array, covariance: Array) -> tuple[Array, Array]:
        new, fitted = published(offsets, weights, mean, covariance)
        values, vectors = np.linalg.eigh(fitted)
        raised = np.maximum(values, (share * COMMAND) ** 2)
        return new, (vectors * raised[:, None, :]) @ vectors.transpose(0, 2, 1)

    return rule


RULES: dict[str, Callable[..., Fit]] = {
    "published": lambda: published,
    "damped": damped,
    "damped_about_new": damped_about_new,
    "bounded": bounded,
    "shared": lambda: shared,
    "floored": floored,
}


@dataclass(frozen=True)
class Setting:
    """A rule with its parameter, and the rest of the learner; what is not named has the value given here."""

    rule: str
    parameter: float | None = None
    epsilon: float = 1.0
    initial_std: float = 1.0
    feedback: float = -1.0
    correlation: float = 0.0

    def fit(self) -> Fit:
        """The rule."""
        return RULES[self.rule]() if self.parameter is None else RULES[self.rule](self.parameter)


def parse_setting(text: str) -> Setting:
    """`rule[:parameter][,key=value...]`, for instance damped:0.5,epsilon=0.5,correlation=4."""
    head, *rest = text.split(",")
    rule, _, parameter = head.partition(":")
    others = {key: float(value) for key, value in (item.split("=") for item in rest)}
    return Setting(rule, float(parameter) if parameter else None, **others)


def run(
    task_name: str, case: str, setting: Setting, seeds: list[int], kinematic: bool, iterations: int | None
) -> pd.DataFrame:
    """Trains one setting on every seed; one row per seed."""
    overrides = [f"algorithm.{k}={v}" for k, v in dataclasses.asdict(setting).items() if k not in ("rule", "parameter")]
    study, _ = read(compose([f"experiment={task_name}", f"cases=[{case}]", *overrides]))
    first = study.runs()[0]
    task, reward, by_step = make_task(first.task), make_reward(first), LEARNERS.get(first.case.learner).by_step
    iterations = iterations or first.algorithm.iterations
    learners = [Learner(s, setting.fit(), setting.epsilon, reward, by_step) for s in seeds]
    start = time.perf_counter()
    curves = train(
        task,
        first.spec,
        Kinematic(task) if kinematic else Simulator(task),
        first_policy(task, first.algorithm),
        learners,
        first.algorithm.samples,
        iterations,
    )
    seconds = time.perf_counter() - start
    satisfied = curves.policy > 0
    return pd.DataFrame(
        {
            "physics": "kinematic" if kinematic else "mujoco",
            "task": task_name,
            "case": case,
            **dataclasses.asdict(setting),
            "iterations": iterations,
            "seed": seeds,
            "final": curves.final.round(4),
            "first_satisfied": np.where(satisfied.any(axis=0), satisfied.argmax(axis=0), -1),
            "area": curves.samples.mean(axis=0).round(4),
            "last_samples": curves.samples[-1].round(4),
            "seconds": round(seconds / len(seeds), 1),
        }
    )


KEYS = ["physics", "task", "case", *(field.name for field in dataclasses.fields(Setting)), "iterations"]


def label(values: dict[str, Any]) -> str:
    """A setting by its rule, its parameter and what differs from the defaults."""
    name = values["rule"] + (f" {values['parameter']:g}" if values["parameter"] == values["parameter"] else "")
    others = dataclasses.fields(Setting)[2:]
    return name + "".join(f", {f.name} {values[f.name]:g}" for f in others if values[f.name] != f.default)


def table(results: pd.DataFrame) -> str:
    """One markdown line per setting."""
    lines = []
    for key, group in results.groupby(["physics", "task", "case"], sort=False):
        lines += ["", f"**{key[1]}, {key[2]}, {key[0]}**", ""]
        lines += ["| setting | its | seeds | satisfied | first satisfied, median | final, median (min .. max) | area |"]
        lines += ["|---|---|---|---|---|---|---|"]
        rows = []
        for setting, part in group.groupby(KEYS[3:], sort=False, dropna=False):
            values = dict(zip(KEYS[3:], setting, strict=True))
            first = part["first_satisfied"].astype("float64").where(part["first_satisfied"] >= 0, np.inf).median()
            final, area = part["final"], part["area"].mean()
            line = (
                f"| {label(values)} | {values['iterations']} | {len(part)} | {(final > 0).sum()} "
                f"| {'never' if np.isinf(first) else f'{first:.0f}'} "
                f"| {final.median():.3f} ({final.min():.3f} .. {final.max():.3f}) | {area:.3f} |"
            )
            rows.append((-area, line))
        lines += [line for _, line in sorted(rows)]
    return "\n".join(lines)


def overview(results: pd.DataFrame) -> str:
    """One markdown line per setting, one column per task and case: seeds satisfied, median final robustness."""
    chosen = results[results["seed"] < OVERVIEW_SEEDS]
    columns = list(dict.fromkeys(zip(chosen["task"], chosen["case"], strict=True)))  # in the order of the file
    lines = ["| setting | " + " | ".join(f"{task} {case}" for task, case in columns) + " |"]
    lines += ["|---" * (len(columns) + 1) + "|"]
    for setting, part in chosen.groupby(KEYS[3:-1], sort=False, dropna=False):
        cells = []
        for task, case in columns:
            final = part.loc[(part["task"] == task) & (part["case"] == case), "final"]
            full = len(final) == OVERVIEW_SEEDS
            cells.append(f"{(final > 0).sum()}, {final.median():.2f}" if full else "")
        if cells.count("") <= len(cells) // 4:
            lines.append(f"| {label(dict(zip(KEYS[3:-1], setting, strict=True)))} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(arguments: list[str]) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="The covariance study.")
    parser.add_argument("what", choices=["run", "table"])
    parser.add_argument("--task", default="reach_avoid")
    parser.add_argument("--case", default="tltl_episodic")
    parser.add_argument("--settings", nargs="+", type=parse_setting, default=[])
    parser.add_argument("--seeds", nargs="+", type=int, default=[10], help="n for 0 .. n-1, or m n for m .. n-1")
    parser.add_argument("--kinematic", action="store_true")
    parser.add_argument("--iterations", type=int)
    parser.add_argument("--results", type=Path, default=RESULTS)
    a = parser.parse_args(arguments)
    if a.what == "table":
        results = pd.read_csv(a.results)
        for physics, part in results.groupby("physics"):
            print(f"\n**{physics}, seeds 0 to {OVERVIEW_SEEDS - 1}**\n\n{overview(part)}")
        print(table(results))
        return
    for setting in a.settings:
        rows = run(a.task, a.case, setting, list(range(*a.seeds)), a.kinematic, a.iterations)
        print(table(rows).splitlines()[-1], f"{rows['seconds'].iloc[0]} s per run", flush=True)
        rows.to_csv(a.results, mode="a", header=not a.results.exists(), index=False)


if __name__ == "__main__":
    main(sys.argv[1:])
