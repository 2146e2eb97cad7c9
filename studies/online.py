"""The picture of docs/online.md: robustness and its bounds while a satisfied and a violated trajectory run.

python -m studies.online docs/online.png
"""

from __future__ import annotations

import argparse

import matplotlib
import numpy as np

from tltlrl.logic import parse_spec

matplotlib.use("Agg")
from matplotlib import pyplot as plt

SPEC = "F[0,40] (x > 1) & G[0,60] (x < 2)"
STEPS = np.arange(71)
PATHS = {
    "satisfied": 1.4 * np.sin(STEPS * np.pi / 64),
    "violated": 1.1 * np.sin(STEPS * np.pi / 64) + 1.5 * np.exp(-(((STEPS - 27) / 3) ** 2)),
}


def main(arguments: list[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser("python -m studies.online")
    parser.add_argument("picture", help="a .png file")
    chosen = parser.parse_args(arguments)
    spec = parse_spec(SPEC)
    figure, axes = plt.subplots(
        2, 2, figsize=(6.5, 4.2), sharex=True, sharey="row", height_ratios=(1, 2), layout="constrained"
    )
    for column, (title, x) in enumerate(PATHS.items()):
        monitor = spec.monitor()
        read = [monitor.update({"x": value}) for value in x]
        robustness, lower, upper = (np.array([r[i][0] for r in read]) for i in range(3))
        assert (lower <= robustness).all()
        assert (robustness <= upper).all()
        above, below = axes[0, column], axes[1, column]
        above.plot(STEPS, x, color="black", lw=1.2)
        above.hlines([1], 0, 40, color="tab:green", ls="--", lw=1)
        above.hlines([2], 0, 60, color="tab:red", ls="--", lw=1)
        lost = np.flatnonzero(upper < 0)
        above.set_title(f"{title}, for good from step {lost[0]} on" if len(lost) else title)
        low, high = -2.4, 2.4
        below.fill_between(
            STEPS, lower.clip(low, high), upper.clip(low, high), color="tab:blue", alpha=0.18, lw=0, step="post"
        )
        below.step(STEPS, upper.clip(low, high), where="post", color="tab:blue", lw=1, label="upper")
        below.step(STEPS, robustness, where="post", color="black", lw=1.6, label="robustness, if it ended now")
        below.step(STEPS, lower.clip(low, high), where="post", color="tab:blue", lw=1, ls=":", label="lower")
        decided = int(np.argmax(lower == upper))
        below.axvline(decided, color="grey", lw=0.8)
        below.annotate(
            f"decided, step {decided}", (decided, -2.1), (-4, 0), textcoords="offset points", ha="right", fontsize=8
        )
        below.axhline(0, color="grey", lw=0.6)
        below.set_ylim(low, high)
        below.set_xlabel("step")
    axes[0, 0].set_ylabel("x")
    axes[1, 0].set_ylabel("robustness")
    figure.suptitle(SPEC, fontsize=10)
    lines = axes[1, 1].get_legend_handles_labels()
    figure.legend(*lines, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    figure.savefig(chosen.picture, dpi=150)


if __name__ == "__main__":
    main()
