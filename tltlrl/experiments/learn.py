"""`tltlrl.learn`: one run from Python, such as in a notebook, with the same bytes as from the command `tltl-run`."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image
from tqdm import tqdm

from tltlrl.config.compose import compose, quoted
from tltlrl.config.read import read
from tltlrl.experiments.results import open_calm
from tltlrl.learning.policy import Policy
from tltlrl.logic import Spec
from tltlrl.reports.plotting import curves_figure, picture
from tltlrl.reports.workspace import can_draw, workspace_figure
from tltlrl.store.files import write_text
from tltlrl.store.layout import PROGRESS
from tltlrl.store.run import read_results
from tltlrl.training.learned import learned_policy
from tltlrl.training.session import train
from tltlrl.training.study import Run
from tltlrl.training.verdict import motions


@dataclass(frozen=True)
class Learned:
    """The results of a run.

    Attributes:
      run: what was asked for.
      folder: folder of its files.
      policy: the learned policy.
      calm: the policy of the calm motion (docs/calm.md), if `algorithm.calm` asks for it and the spec is satisfied.
      curves: one row per iteration; runs/README.md says what the columns mean.
      robustness: of the mean motion; above 0 the spec is satisfied.
      successes, trials: how many noisy trials satisfied the spec, and how many there were.
    """

    run: Run
    folder: Path
    policy: Policy
    curves: pd.DataFrame
    robustness: float
    successes: int
    trials: int
    calm: Policy | None = None

    def signals(self, policy: Policy | None = None) -> dict[str, np.ndarray]:
        """The signals of the mean motion: name => (T,) or (T, k); add a leading axis for `Spec.explain` and others.

        Args:
          policy: the policy that moves; the learned one if not given.
        """
        moved = motions(self.run, policy or self.policy, 0, np.random.default_rng(0))
        return {name: values[0, : moved.lengths[0]] for name, values in moved.signals.items()}

    def picture(self, policy: Policy | None = None) -> Image.Image:
        """A picture of the motion, if there is a point whose path can be drawn; otherwise the learning curve.

        Args:
          policy: the policy that moves; the learned one if not given.
        """
        if not can_draw(self.run):
            return self.curve()
        return _image(workspace_figure(self.run, policy or self.policy))

    def curve(self) -> Image.Image:
        """A picture of the learning curve: robustness against iterations."""
        return _image(curves_figure({str(self.curves["task"].iloc[0]): self.curves}))


def learn(
    task: str,
    spec: str | Path | Spec | None = None,
    iterations: int = 200,
    seed: int = 0,
    *,
    case: str = "tltl_episodic",
    settings: Mapping[str, Any] | None = None,
    folder: str | Path | None = None,
) -> Learned:
    """Learns a task from a spec.

        learned = tltlrl.learn("reach_avoid", "my_task.tltl", iterations=60)
        learned.curves.plot("iteration", "robustness_policy")
        learned.picture()

    Args:
      task: its name, as in `tltl-run task=NAME`.
      spec: what to learn: a file, the name of a spec that comes with tltlrl, or a `Spec`; the task's own spec if not
        given.
      iterations: policy updates.
      seed: seed of all noise.
      case: <reward>_<learner>.
      settings: any other key of the config, as {"algorithm.samples": 30} or {"experiment": "reach_avoid_best"}.
      folder: a folder for this run alone; a run that was stopped there is resumed. A temporary one if not given.

    Raises:
      UserError, SpecError: if something has to be mended; the message says what.
    """
    place = Path(tempfile.mkdtemp(prefix="tltlrl-")) if folder is None else Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    given: dict[str, Any] = {"algorithm.iterations": iterations, **(settings or {})}
    constants: Mapping[str, Any] = {}
    if isinstance(spec, Spec):
        constants = spec.constants
        path = place / "spec.tltl"
        write_text(path, spec.text)
        spec = path
    texts = [] if spec is None else [f"spec={quoted(str(spec))}"]
    overrides = [f"{key}={_written(value)}" for key, value in given.items()]
    config = compose([f"task={task}", f"cases=[{case}]", f"seeds=[{seed}]", *texts, *overrides])
    study, _ = read(config | {"constants": {**config["constants"], **constants}})
    (run,) = study.runs()
    with tqdm(total=iterations + run.algorithm.calm, unit="it") as bar:

        def report(done: int) -> None:
            bar.update(done - bar.n)

        train(run, place, report)
    results = read_results(place, run.identity())
    assert results is not None
    curves, robustness = pd.read_csv(place / PROGRESS), results["robustness_policy"]
    policy, calm = learned_policy(place), open_calm(run, place)
    return Learned(run, place, policy, curves, robustness, results["successes"], results["trials"], calm)


def _written(value: Any) -> str:
    """A value as the text of an override."""
    if isinstance(value, str):
        return quoted(value)
    if isinstance(value, list | tuple):
        return f"[{','.join(map(_written, value))}]"
    return "null" if value is None else str(value).lower() if isinstance(value, bool) else repr(value)


def _image(figure: Any) -> Image.Image:
    return Image.open(io.BytesIO(picture(figure, ".png", 120)))
