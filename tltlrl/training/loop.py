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
import json
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tltlrl.errors import UserError, nearest
from tltlrl.learning.policy import Policy
from tltlrl.learning.reps import Update, episode_based, step_based
from tltlrl.logic import Spec, reasons
from tltlrl.simulation.rollout import Simulator
from tltlrl.simulation.trials import mean_motion, trials
from tltlrl.store.files import naming, sweep, write_bytes
from tltlrl.store.record import (
    CHECKPOINT,
    DONE,
    PROGRESS,
    TIMING,
    Checkpoint,
    DamagedError,
    digest,
    first_rows,
    read_checkpoint,
    read_results,
    write_checkpoint,
    write_results,
)
from tltlrl.tasks import task_entry
from tltlrl.tasks.task import Signals, Task

Array = NDArray[np.float64]

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
LOCK_SECONDS = 10.0  # a worker whose command was killed ends within a few


@dataclass(frozen=True)
class AlgorithmConfig:
    """Policy search; the defaults are in configs/algorithm/reps.yaml.

    Attributes:
      iterations: policy updates.
      samples: trajectories per iteration.
      epsilon: bound of the samples' KL per update, nats; below log(samples).
      covariance: "damped" or "published" fit of Sigma_t; see tltlrl.learning.reps.fit.
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

    def identity(self) -> str:
        """A digest of everything above, by which a run's files are known to be its own."""
        spec = {"text": self.spec.text, "constants": dict(self.spec.constants)}
        asked = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)} | {"spec": spec}
        return digest(json.dumps(asked, sort_keys=True, default=dataclasses.asdict).encode())

    def make_task(self) -> Task:
        """The task; its hand-made rewards only where they are trained on, since they ask more of the spec."""
        entry = task_entry(self.task.name)
        reward = self.reward
        if self.case.algorithm == "step":
            reward = dataclasses.replace(reward, **reward.step)
        hand_made = {} if self.case.reward == "tltl" else entry.rewards(reward, self.spec.constants)
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
        sweep(folder)
        with contextlib.suppress(DamagedError):
            if read_results(folder, run.identity()) is not None:
                (folder / CHECKPOINT).unlink(missing_ok=True)
                return
        (folder / DONE).unlink(missing_ok=True)
        _train(run, folder, report)


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Keeps a second process, such as a remote worker that outlived its command, from writing to the same run.

    Raises:
      UserError: if another process holds it, and does so for long.
    """
    descriptor = os.open(folder, os.O_RDONLY)
    deadline = time.monotonic() + LOCK_SECONDS
    try:
        while True:
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError as error:
                if time.monotonic() > deadline:
                    raise UserError(
                        f"{folder}: another process still computes this run; stop it, and start again"
                    ) from error
                time.sleep(0.05)
        yield
    finally:
        os.close(descriptor)


def _train(run: Run, folder: Path, report: Callable[[int], None]) -> None:
    task = run.make_task()
    simulator = Simulator(task)
    first, policy, env_steps = resume(folder, run.identity(), initial_policy(task, run.algorithm))
    same = {
        "task": task.name,
        "case": run.case.name,
        "reward": run.case.reward,
        "algorithm": run.case.algorithm,
        "seed": run.seed,
    }
    last_checkpoint = time.monotonic()
    with (
        naming(folder / PROGRESS),
        open(folder / PROGRESS, "a", newline="") as progress,
        open(folder / TIMING, "a", newline="") as timing,
    ):
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
                write_checkpoint(folder, run.identity(), Checkpoint(i + 1, env_steps, policy.mean, policy.covariance))
                last_checkpoint = time.monotonic()
    finish(run, task, simulator, policy, folder)


def resume(folder: Path, identity: str, start: Policy) -> tuple[int, Policy, int]:
    """Iterations done, the policy and the samples after them; cuts the CSV files back to the checkpoint.

    Without a checkpoint, or with one that cannot be gone on from, the run starts again from `start`.
    """
    try:
        saved = read_checkpoint(folder, identity)
    except DamagedError:  # told by the command before; see tltlrl.experiments.experiment.survey
        saved = None
    if saved is None:
        for name in (CHECKPOINT, PROGRESS, TIMING):
            (folder / name).unlink(missing_ok=True)
        return 0, start, 0
    for name in (PROGRESS, TIMING):
        write_bytes(folder / name, first_rows(folder / name, saved.iteration))
    return saved.iteration, Policy(start.gain, saved.mean, saved.covariance, start.correlation), saved.env_steps


def finish(run: Run, task: Task, simulator: Simulator, policy: Policy, folder: Path) -> None:
    """Judges the learned policy and writes policy.npz and done.json."""
    motion = mean_motion(simulator, policy)
    why = run.spec.explain(task.signals(motion.features, motion.commands), motion.lengths)
    of_policy = why[0].value
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials])
    tried = try_policy(run, policy, run.trials, rng)
    write_results(
        folder,
        run.identity(),
        policy,
        {
            "iterations": run.algorithm.iterations,
            "robustness_policy": of_policy,
            "satisfied": of_policy > 0,
            "trials": run.trials,
            "successes": int(np.sum(tried.robustness > 0)),
            "outcomes": {name: int(np.sum(values)) for name, values in tried.outcomes.items()},
            "why_policy_fails": reasons.to_json(reasons.failed(why)),
            "why_trials_fail": reasons.to_json(reasons.failed(run.spec.explain(tried.signals, tried.lengths))),
        },
    )


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
