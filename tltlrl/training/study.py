"""What is asked for: a study, and the runs it consists of. Plain data that checks itself and builds nothing.

Rules that need two parts, such as the signals of spec and task, are checked where the parts meet: `training.check`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tltlrl.errors import UserError
from tltlrl.learning.reps import RepsSettings
from tltlrl.learning.scores import TOLD
from tltlrl.resources import user_path
from tltlrl.settings import Role, check, check_value, fields_with, setting, settings_of, without_places
from tltlrl.store.files import digest
from tltlrl.store.layout import POLICY

if TYPE_CHECKING:
    from tltlrl.logic import Spec

TLTL = "tltl"  # the reward that is the spec's own robustness
MOST_SEEDS = MOST_TRIALS = MOST_SAMPLES = 10_000  # more would not fit into memory, and fail only after hours

# Raised when the same settings give other results, so that old results are not taken for new ones.
LEXIMIN_EDITION = 2  # over conjuncts, no longer over clauses
CALM_EDITION = 3  # shortcuts that know the events, tried from other starts, too
NORMALISE_EDITION = 2  # a predicate that never changes is divided by its margin


@dataclass(frozen=True)
class AlgorithmConfig:
    """The settings of policy search that all learners share: the budget and the first policy."""

    iterations: int = setting("policy updates", 200, least=1, role=Role.COMMON | Role.BUDGET | Role.GROWS)
    samples: int = setting("trajectories per iteration", 20, least=2, most=MOST_SAMPLES, role=Role.COMMON)
    initial_std: float = setting(
        "exploration of the first policy, as a share of a full command", 1.0, above=0, most=100
    )
    feedback: float = setting("the fixed gain K, in units of the task's feedback matrix", -1.0, least=-1e6, most=1e6)
    correlation: float = setting(
        "width of the exploration noise's correlation over time, steps; 0 for independent steps", 1.0, least=0
    )
    exploration: dict[str, float] = setting(
        "exploration of single groups of commands, by their names, in place of initial_std",
        {},
        above=0,
        most=100,
        role=Role.LATER,
    )
    basis: int = setting(
        "basis functions that a motion is made of; 0: an offset of its own at every step", 0, least=0, role=Role.LATER
    )
    told: str = setting(
        "what the learner is told about a trajectory in the cases tltl_*: its robustness, or leximin, which weighs all "
        "conjuncts of the spec, the worst first",
        "robustness",
        choices=TOLD,
        role=Role.COMMON | Role.LATER,
    )
    normalise: bool = setting(
        "divide every predicate by its spread over the first iteration's trajectories, in what the learner is told",
        False,
        role=Role.COMMON | Role.LATER,
    )
    keep: str = setting(
        "the policy that a run ends with: the last, or the best of those whose mean motion was simulated",
        "last",
        choices=("last", "best"),
        role=Role.COMMON | Role.LATER,
    )
    calm: int = setting(
        "batches of 20 proposals that make the learned motion calm afterwards, as a second policy; 0: none",
        0,
        least=0,
        role=Role.COMMON | Role.LATER | Role.BUDGET,
    )
    calm_share: float = setting(
        "share of the learned robustness that a calm motion has to keep",
        0.7,
        above=0,
        most=1,
        role=Role.COMMON | Role.LATER,
    )
    refine: dict[str, Any] = setting(
        "a second stage around the motion that the first one learned: after (iterations), and any other key of "
        "algorithm that is to change",
        {},
        role=Role.COMMON | Role.LATER,
    )
    policy: str = setting(
        "a policy.npz, or the folder of a run; learning starts from its mean motion, not from the task's reference",
        "",
        role=Role.COMMON | Role.LATER,
    )

    def __post_init__(self) -> None:
        check(self, "algorithm")

    def start(self) -> bytes | None:
        """The bytes of the file of the policy to start from; None if there is none.

        Raises:
          UserError: if it cannot be read.
        """
        if not self.policy:
            return None
        path = user_path(self.policy)
        try:
            return (path / POLICY if path.is_dir() else path).read_bytes()
        except OSError as error:
            raise UserError(
                f"algorithm.policy: {path} cannot be read ({error.strerror}); give the policy.npz of a run"
            ) from error


def with_later(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The config of a result of any version, with keys added that it lacks, at their defaults."""
    return {**settings, "algorithm": {**LATER, **settings["algorithm"]}}


LATER = {  # keys with the role `Role.LATER`, and their defaults
    name: getattr(kind(), name) for kind in (AlgorithmConfig, RepsSettings) for name in fields_with(Role.LATER, kind)
}


@dataclass(frozen=True)
class Stage:
    """A stage of a run: iterations with the same exploration and settings.

    Attributes:
      first: its first iteration.
      algorithm: policy search.
      learner: the learner's own settings.
    """

    first: int
    algorithm: AlgorithmConfig
    learner: Any


@contextlib.contextmanager
def in_second_stage(changed: Collection[str]) -> Iterator[None]:
    """A context in which mistakes in keys of `algorithm.refine` are told of these, and not of `algorithm`."""
    try:
        yield
    except UserError as error:
        section, _, rest = str(error).partition(".")
        if section == "algorithm" and re.split(r"\W", rest)[0] in changed:
            raise UserError(f"algorithm.refine.{rest}") from error
        raise


@dataclass(frozen=True)
class Case:
    """What is compared: a reward and a learner, by their names.

    Attributes:
      reward: `tltl`, or one of the task's hand-made rewards.
      learner: a name in `tltlrl.registry.LEARNERS`.
    """

    reward: str
    learner: str

    @property
    def name(self) -> str:
        """The case's name, as in configs, folders and CSV files."""
        return f"{self.reward}_{self.learner}"


@dataclass(frozen=True)
class Run:
    """Everything that decides the bytes of one run.

    Attributes:
      task: the task's own config dataclass.
      reward: the coefficients of its hand-made rewards.
      spec: what is learned in cases tltl_*; every case is measured by it.
      case: reward and learner.
      seed: seed of all noise.
      algorithm: policy search.
      learner: the learner's own settings.
      trials: noisy trials of the learned policy.
      refine: the second stage, if there is one.
    """

    task: Any
    reward: Any
    spec: Spec
    case: Case
    seed: int
    algorithm: AlgorithmConfig
    learner: Any
    trials: int
    refine: Stage | None = None

    def stage(self, iteration: int) -> Stage:
        """The stage that an iteration belongs to."""
        if self.refine is not None and iteration >= self.refine.first:
            return self.refine
        return Stage(0, self.algorithm, self.learner)

    def identity(self) -> str:
        """SHA-256 of all attributes; a run's files hold it, so that they can be told from another run's.

        Keys that 0.1 did not have are left out where they are at their default. So results of 0.1 keep their identity.
        """
        algorithm = dataclasses.asdict(self.algorithm) | dataclasses.asdict(self.learner)
        if (start := self.algorithm.start()) is not None:
            algorithm["policy"] = digest(start)  # its bytes count, not its path
        edition = getattr(self.task, "edition", 1)  # of what its settings simulate; see PlanarArmConfig
        asked = {
            "task": without_places(self.task) | ({"edition": edition} if edition > 1 else {}),
            "reward": dataclasses.asdict(self.reward),
            "spec": {"text": self.spec.text, "constants": dict(self.spec.constants)},
            "case": {"reward": self.case.reward, "algorithm": self.case.learner},
            "seed": self.seed,
            "algorithm": {name: value for name, value in algorithm.items() if LATER.get(name, ...) != value},
            "trials": self.trials,
        }
        if self.algorithm.told == "leximin":
            asked["leximin"] = LEXIMIN_EDITION
        if self.algorithm.calm:
            asked["calm"] = CALM_EDITION
        if self.algorithm.normalise and self.case.reward == TLTL:
            asked["normalise"] = NORMALISE_EDITION
        return digest(json.dumps(asked, sort_keys=True).encode())


@dataclass(frozen=True)
class Study:
    """A study: every case with every seed.

    Attributes:
      name: name of its folder.
      task, reward: config dataclasses of the task and of its hand-made rewards.
      spec: what is learned; every case is measured by it.
      cases, seeds: what is compared.
      algorithm: the same for every case.
      learners: name of a learner => its own settings, for every learner among the cases.
      refine: name of a learner => its second stage, if there is one.
      trials: noisy trials of each learned policy.
      settings: the config as given, less what does not change the results; kept in config.yaml.
    """

    name: str
    task: Any
    reward: Any
    spec: Spec
    cases: tuple[Case, ...]
    seeds: tuple[int, ...]
    algorithm: AlgorithmConfig
    learners: Mapping[str, Any]
    trials: int = setting(
        "noisy trials of each learned policy, for the success rate", 100, least=1, most=MOST_TRIALS, role=Role.BUDGET
    )
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    refine: Mapping[str, Stage] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.name.isprintable() or not self.name.strip(". ") or "/" in self.name:
            raise UserError(f"name: {self.name!r} cannot be a folder's name")
        if not self.cases or len(set(self.cases)) < len(self.cases):
            raise UserError(f"cases: {[c.name for c in self.cases]} must name at least one case, and each once")
        wrong = any(type(seed) is not int or seed < 0 for seed in self.seeds)
        if wrong or not self.seeds or len(set(self.seeds)) < len(self.seeds):
            raise UserError(
                f"seeds: {list(self.seeds)} must be a number n >= 1 for the seeds 0 .. n-1, or a list of different "
                "numbers >= 0"
            )
        if len(self.seeds) > MOST_SEEDS or max(self.seeds) >= 2**63:
            raise UserError(f"seeds: at most {MOST_SEEDS}, each below 2**63")
        check_value("trials", self.trials, settings_of(Study)["trials"])

    def runs(self) -> list[Run]:
        """One run per case and seed, in the order of the tables."""
        return [
            Run(
                self.task,
                self.reward,
                self.spec,
                case,
                seed,
                self.algorithm,
                self.learners[case.learner],
                self.trials,
                self.refine.get(case.learner),
            )
            for case in self.cases
            for seed in self.seeds
        ]
