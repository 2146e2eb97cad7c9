"""PPO and SAC of Stable-Baselines3 on the specs of the case study, telescoped against final reward.

    python examples/stable_baselines3/train.py --seeds 3 --output results.csv

One row per run is added to the file as soon as the run is over; runs that it holds already are left out.
"""

from __future__ import annotations

import argparse
import csv
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

import tltlrl.gym  # noqa: F401  # registers the environments

TASKS = {"reach_avoid": "tltlrl/ReachAvoid-v0", "visit_in_order": "tltlrl/VisitInOrder-v0"}
COUNT = 20  # environments side by side, as many as REPS has trajectories per iteration
EVERY = 10_000  # environment steps between two looks at the policy
TRIALS = 100
COLUMNS = ("task", "learner", "reward", "seed", "steps", "first_satisfied", "robustness", "satisfied", "seconds")


def vector(task: str, count: int, **keys: Any) -> Any:
    """`count` environments of a task, stepped in one call."""
    return gymnasium.make_vec(TASKS[task], num_envs=count, vectorization_mode="vector_entry_point", **keys)


class Together(VecEnv):
    """A vector environment of tltlrl as Stable-Baselines3 wants it: an episode begins in the step that ends another.

    All episodes have the same length here, so all of them begin at once.
    """

    def __init__(self, envs: Any, seed: int) -> None:
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self._envs, self._seed = envs, seed

    def reset(self) -> Any:
        observations, _ = self._envs.reset(seed=self._seed)
        return observations

    def step_async(self, actions: Any) -> None:
        self._actions = actions

    def step_wait(self) -> Any:
        observations, rewards, over, _, _ = self._envs.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if over.any():
            assert over.all()
            for info, last in zip(infos, observations, strict=True):
                info["terminal_observation"] = last
            observations, _ = self._envs.reset()
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        self._envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [None] * self.num_envs  # asked for render_mode alone

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **keys: Any) -> list[Any]:
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs


def judged(model: Any, envs: Any, seed: int = 0) -> Any:
    """The robustness of one episode of each environment under the mean policy, (N,)."""
    observations, _ = envs.reset(seed=seed)
    over = np.zeros(envs.num_envs, dtype=bool)
    while not over.any():
        actions, _ = model.predict(observations, deterministic=True)
        observations, _, over, _, infos = envs.step(actions)
    return infos["robustness"]


class Looks(BaseCallback):
    """Evaluates the mean policy without noise every so many steps; remembers when it satisfied the spec first."""

    def __init__(self, task: str) -> None:
        super().__init__()
        self._envs, self._next = vector(task, 1, noise=False), EVERY
        self.first: int | None = None

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._next:
            self._next += EVERY
            self.look()
        return True

    def look(self) -> float:
        """The robustness of the mean policy now."""
        (robustness,) = judged(self.model, self._envs)
        if robustness > 0 and self.first is None:
            self.first = self.num_timesteps
        return float(robustness)


def run(task: str, learner: str, reward: str, seed: int, steps: int) -> dict[str, Any]:
    """Train once and judge what was learned."""
    start = time.process_time()
    envs = Together(vector(task, COUNT, reward=reward), seed=1000 * seed)
    # No discount: only then the rewards sum to the robustness. All else that is not named is the learner's default.
    if learner == "PPO":
        horizon = 200 if task == "reach_avoid" else 500
        model: Any = PPO("MlpPolicy", envs, gamma=1.0, n_steps=horizon, batch_size=500, seed=seed, device="cpu")
    else:
        model = SAC("MlpPolicy", envs, gamma=1.0, gradient_steps=1, seed=seed, device="cpu")
    looks = Looks(task)
    model.learn(steps, callback=looks)
    final = looks.look()
    trials = judged(model, vector(task, TRIALS), seed=1_000_000 + seed)
    return {
        "task": task,
        "learner": learner,
        "reward": reward,
        "seed": seed,
        "steps": model.num_timesteps,
        "first_satisfied": "" if looks.first is None else looks.first,
        "robustness": f"{final:.6f}",
        "satisfied": int((trials > 0).sum()),
        "seconds": round(time.process_time() - start),
    }


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--ppo-steps", type=int, default=250_000)
    parser.add_argument("--sac-steps", type=int, default=50_000)
    parser.add_argument("--output", type=Path, default=Path("results.csv"))
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    held = set()
    if chosen.output.exists():
        with chosen.output.open(newline="") as file:
            held = {tuple(row[name] for name in COLUMNS[:4]) for row in csv.DictReader(file)}
    else:
        chosen.output.write_text(",".join(COLUMNS) + "\n")
    for seed in range(chosen.seeds):
        for task in TASKS:
            for learner, steps in (("PPO", chosen.ppo_steps), ("SAC", chosen.sac_steps)):
                for reward in ("telescoped", "final"):
                    if (task, learner, reward, str(seed)) in held:
                        continue
                    row = run(task, learner, reward, seed, steps)
                    with chosen.output.open("a", newline="") as file:
                        csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row)
                    print(row, flush=True)


if __name__ == "__main__":
    main()
