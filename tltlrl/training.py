"""One run: sample, score, update, record, checkpoint.

A run is a pure function of its `Run`: the noise of iteration i comes from a generator seeded with (seed, i), so a run
that was interrupted goes on from its checkpoint to the same bytes as one that was not, and the cases of one seed
share their noise (common random numbers).
"""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import fcntl
import os
import time
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.evaluation import mean_motion, trials
from tltlrl.files import read_arrays, write_arrays, write_json, write_text
from tltlrl.policy import Policy
from tltlrl.reps import Update, episode_based, step_based
from tltlrl.rollout import Simulator
from tltlrl.spec import Spec
from tltlrl.tasks import task_entry
from tltlrl.tasks.task import Signals, Task

Array = NDArray[np.float64]

PROGRESS, TIMING, POLICY, DONE, CHECKPOINT = (
    "progress.csv",
    "timing.csv",
    "policy.npz",
    "done.json",
    "checkpoint.npz",
)
PROGRESS_COLUMNS = (
    "task",
    "case",
    "reward",
    "algorithm",
    "seed",
    "iteration",
    "episodes",
    "env_steps",
    "return_mean",
    "robustness_mean",
    "robustness_std",
    "robustness_min",
    "robustness_max",
    "robustness_policy",
    "satisfied_fraction",
    "eta",
    "kl",
    "effective_sample_size",
    "entropy",
)
TIMING_COLUMNS = ("iteration", "seconds", "physics_seconds")
CHECKPOINT_SECONDS = 2.0


@dataclass(frozen=True)
class AlgorithmConfig:
    """Policy search; the defaults are in configs/algorithm/reps.yaml.

    Attributes:
      iterations: policy updates.
      samples: trajectories per iteration.
      epsilon: bound of the samples' KL per update, nats; below log(samples).
      covariance: "damped" or "published" fit of Sigma_t; see tltlrl.reps.fit.
      kept: share of the old covariance in the damped fit, in [0, 1).
      initial_std: exploration of the first policy, as a share of each command's full size.
      feedback: strength of the fixed gain K, in units of the task's own feedback matrix.
      correlation: width in steps of the exploration noise's correlation over time; 0 for none.
    """

    iterations: int
    samples: int
    epsilon: float
    covariance: str
    kept: float
    initial_std: float
    feedback: float
    correlation: float


@dataclass(frozen=True)
class Case:
    """What is trained: a reward and the kind of REPS, from a name such as discrete_step."""

    reward: str
    algorithm: str

    @property
    def name(self) -> str:
        """The case's name, as in configs, folders and CSV files."""
        return f"{self.reward}_{self.algorithm}"


def case_names(hand_made: list[str]) -> list[str]:
    """The cases of a task with these hand-made rewards: robustness is known at the end only, so never by step."""
    return ["tltl_episodic", *(f"{r}_episodic" for r in hand_made), *(f"{r}_step" for r in hand_made)]


def parse_case(name: str, hand_made: list[str]) -> Case:
    """The case of that name.

    Raises:
      UserError: if there is none.
    """
    if name not in case_names(hand_made):
        raise UserError(f"cases: no case is named {name}{nearest(name, case_names(hand_made))}")
    reward, _, algorithm = name.rpartition("_")
    return Case(reward, algorithm)


@dataclass(frozen=True)
class Run:
    """Everything that decides the bytes of one run.

    Attributes:
      task: the task's own config dataclass.
      reward: the coefficients of its hand-made rewards.
      spec: trained on (case tltl_*) and measured by (every case).
      case: what is trained.
      seed: of all noise.
      algorithm: policy search.
      trials: noisy trials of the learned policy.
    """

    task: Any
    reward: Any
    spec: Spec
    case: Case
    seed: int
    algorithm: AlgorithmConfig
    trials: int

    def make_task(self) -> Task:
        """The task; its hand-made rewards only where they are trained on, since they ask more of the spec."""
        entry = task_entry(self.task.name)
        hand_made = {} if self.case.reward == "tltl" else entry.rewards(self.reward, self.spec.constants)
        return entry.make(self.task, hand_made)

    def make_evaluation_task(self) -> Task:
        """The task as learned policies are tried on it: the same, or a more truthful scene if the task has one."""
        return dataclasses.replace(self, task=task_entry(self.task.name).evaluation(self.task)).make_task()


def initial_policy(task: Task, algorithm: AlgorithmConfig) -> Policy:
    """u_t = u_ref_t + K (s_t - s_ref_t) + noise, the noise a share of each command's full size."""
    features, commands = task.reference()
    gain = algorithm.feedback * task.feedback
    covariance = np.diag((algorithm.initial_std * task.command_scale) ** 2)
    return Policy(gain, commands - features @ gain.T, np.tile(covariance, (task.steps, 1, 1)), algorithm.correlation)


@dataclass(frozen=True)
class Iteration:
    """What one iteration saw and learned.

    Attributes:
      policy: the next one.
      record: the columns of progress.csv that depend on the iteration alone.
      env_steps: samples of its trajectories, those after an early end not counted.
      physics_seconds: time in simulation.
    """

    policy: Policy
    record: dict[str, float]
    env_steps: int
    physics_seconds: float


def iterate(run: Run, task: Task, simulator: Simulator, policy: Policy, iteration: int) -> Iteration:
    """One iteration of policy search: N sampled trajectories, and in the same batch the noise-free mean policy."""
    rng = np.random.default_rng([run.seed, iteration])
    samples = run.algorithm.samples
    offsets = np.concatenate([policy.sample(samples, rng), policy.mean[None]])
    noise = np.concatenate([simulator.draw_command_noise(samples, rng), np.zeros((1, *policy.mean.shape))])
    start = time.perf_counter()
    trajectories = simulator.rollout(policy.gain, offsets, noise)
    physics_seconds = time.perf_counter() - start

    signals = task.signals(trajectories.features, trajectories.commands)
    robustness = run.spec.robustness(signals, trajectories.lengths)
    sampled, of_policy = robustness[:samples], robustness[samples]
    returns, update = learn(run, task, signals, sampled, offsets[:samples], policy)
    weighting = update.weighting
    record = {
        "return_mean": returns.mean(),
        "robustness_mean": sampled.mean(),
        "robustness_std": sampled.std(),
        "robustness_min": sampled.min(),
        "robustness_max": sampled.max(),
        "robustness_policy": of_policy,
        "satisfied_fraction": np.mean(sampled > 0),
        "eta": np.median(weighting.eta),
        "kl": np.mean(weighting.kl),
        "effective_sample_size": np.mean(weighting.effective_sample_size),
        "entropy": policy.entropy(),
    }
    following = Policy(policy.gain, update.mean, update.covariance, policy.correlation)
    env_steps = int(trajectories.lengths[:samples].sum())
    return Iteration(following, {name: float(value) for name, value in record.items()}, env_steps, physics_seconds)


def learn(
    run: Run, task: Task, signals: Signals, robustness: Array, offsets: Array, policy: Policy
) -> tuple[Array, Update]:
    """Returns of the sampled trajectories in the reward's own units, shape (N,), and the update they lead to.

    After an early end a hand-made reward goes on as at the last sample (an absorbing state): otherwise an episode
    that ends early would be spared its costs.
    """
    a = run.algorithm
    settings = (policy.mean, policy.covariance, a.epsilon, a.covariance, a.kept)
    if run.case.reward == "tltl":
        return robustness, episode_based(offsets, robustness, *settings)
    rewards = task.rewards[run.case.reward]({name: values[: len(offsets)] for name, values in signals.items()})
    returns = rewards.sum(axis=1)
    if run.case.algorithm == "step":
        return returns, step_based(offsets, rewards, *settings)
    return returns, episode_based(offsets, returns, *settings)


def train(run: Run, folder: Path, report: Callable[[int], None]) -> None:
    """Does what is missing of a run: progress.csv, timing.csv, policy.npz and, last, done.json.

    Args:
      run: what to do.
      folder: where; a checkpoint in it is gone on from.
      report: called with the number of finished iterations.

    Raises:
      ValueError: if a return is not a number; the folder keeps what was done before.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with _held(folder):
        if (folder / DONE).exists():
            (folder / CHECKPOINT).unlink(missing_ok=True)
        else:
            _train(run, folder, report)


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Keeps a second process, such as a remote worker that outlived its command, from writing to the same run.

    Raises:
      UserError: if another process holds it.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise UserError(f"{folder}: another process still computes this run; stop it, and start again") from error
    finally:
        os.close(descriptor)


def _train(run: Run, folder: Path, report: Callable[[int], None]) -> None:
    task = run.make_task()
    simulator = Simulator(task)
    first, policy, env_steps = resume(folder, initial_policy(task, run.algorithm))
    same = {
        "task": task.name,
        "case": run.case.name,
        "reward": run.case.reward,
        "algorithm": run.case.algorithm,
        "seed": run.seed,
    }
    last_checkpoint = time.monotonic()
    with open(folder / PROGRESS, "a", newline="") as progress, open(folder / TIMING, "a", newline="") as timing:
        progress_rows = csv.DictWriter(progress, PROGRESS_COLUMNS, lineterminator="\n")
        timing_rows = csv.DictWriter(timing, TIMING_COLUMNS, lineterminator="\n")
        if first == 0:
            progress_rows.writeheader()
            timing_rows.writeheader()
        for i in range(first, run.algorithm.iterations):
            start = time.perf_counter()
            result = iterate(run, task, simulator, policy, i)
            policy = result.policy
            env_steps += result.env_steps
            counts = {"iteration": i, "episodes": (i + 1) * run.algorithm.samples, "env_steps": env_steps}
            progress_rows.writerow(same | counts | result.record)
            seconds = time.perf_counter() - start
            timing_rows.writerow({"iteration": i, "seconds": seconds, "physics_seconds": result.physics_seconds})
            report(i + 1)
            if time.monotonic() - last_checkpoint > CHECKPOINT_SECONDS:
                progress.flush()
                timing.flush()
                write_arrays(
                    folder / CHECKPOINT,
                    iteration=i + 1,
                    env_steps=env_steps,
                    mean=policy.mean,
                    covariance=policy.covariance,
                )
                last_checkpoint = time.monotonic()
    finish(run, task, simulator, policy, folder)


def resume(folder: Path, start: Policy) -> tuple[int, Policy, int]:
    """Iterations done, the policy and the samples after them; cuts the CSV files back to the checkpoint.

    Without a checkpoint, or with one that cannot be read or that has more iterations than progress.csv, the run
    starts again from `start`.
    """
    iteration, policy, env_steps = 0, start, 0
    try:
        saved = read_arrays(folder / CHECKPOINT)
        rows = (folder / PROGRESS).read_text().splitlines(keepends=True)
        timing = (folder / TIMING).read_text().splitlines(keepends=True)
        done = int(saved["iteration"])
        if min(len(rows), len(timing)) > done and saved["mean"].shape == start.mean.shape:
            env_steps = int(saved["env_steps"])
            policy = Policy(start.gain, saved["mean"], saved["covariance"], start.correlation)
            iteration = done
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        pass
    if iteration:
        write_text(folder / PROGRESS, "".join(rows[: iteration + 1]))
        write_text(folder / TIMING, "".join(timing[: iteration + 1]))
    else:
        (folder / PROGRESS).unlink(missing_ok=True)
        (folder / TIMING).unlink(missing_ok=True)
    return iteration, policy, env_steps


def finish(run: Run, task: Task, simulator: Simulator, policy: Policy, folder: Path) -> None:
    """Judges the learned policy and writes policy.npz and done.json."""
    motion = mean_motion(simulator, policy)
    of_policy = float(run.spec.robustness(task.signals(motion.features, motion.commands), motion.lengths)[0])
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials])
    tried = try_policy(run, policy, run.trials, rng)
    write_arrays(
        folder / POLICY,
        gain=policy.gain,
        mean=policy.mean,
        covariance=policy.covariance,
        correlation=policy.correlation,
    )
    write_json(
        folder / DONE,
        {
            "iterations": run.algorithm.iterations,
            "robustness_policy": of_policy,
            "satisfied": of_policy > 0,
            "trials": run.trials,
            "successes": int(np.sum(tried.robustness > 0)),
            "outcomes": {name: int(np.sum(values)) for name, values in tried.outcomes.items()},
        },
    )
    (folder / CHECKPOINT).unlink(missing_ok=True)


@dataclass(frozen=True)
class Trials:
    """Trials of a learned policy, in the evaluation scene, with the actuators' noise.

    Attributes:
      robustness: of each trial, shape (count,).
      outcomes: what the task judges by other means than the spec: name -> whether, shape (count,).
      signals, lengths: of the trials, for explanations.
    """

    robustness: Array
    outcomes: dict[str, NDArray[np.bool_]]
    signals: Signals
    lengths: NDArray[np.int64]


def try_policy(run: Run, policy: Policy, count: int, rng: np.random.Generator) -> Trials:
    """`count` trials of the mean policy."""
    task = run.make_evaluation_task()
    motion = trials(Simulator(task), policy, count, rng)
    signals = task.signals(motion.features, motion.commands)
    robustness = run.spec.robustness(signals, motion.lengths)
    return Trials(robustness, task.outcomes(motion.last_qpos, motion.last_qvel), signals, motion.lengths)
