"""The table of keys against the configs that come with tltlrl."""

import dataclasses

import pytest
import yaml

from tltlrl.config.compare import differences
from tltlrl.config.compose import GROUPS, compose, names
from tltlrl.config.keys import KEYS, having, is_budget, machinery_defaults, result_keys, sections
from tltlrl.config.machinery import Machinery
from tltlrl.errors import UserError
from tltlrl.learning.reps import RepsSettings
from tltlrl.registry import LEARNERS, OUTSIDE, TASKS
from tltlrl.resources import CONFIGS
from tltlrl.settings import Role, fields_with, setting
from tltlrl.training.study import AlgorithmConfig


def test_the_table_has_the_keys_of_a_config_and_no_other():
    assert set(compose(["experiment=reach_avoid"])) == set(KEYS)


@pytest.mark.parametrize("experiment", names("experiment"))
def test_every_key_of_every_section_says_what_it_means(experiment):
    config = compose([f"experiment={experiment}"])
    for section, settings in sections(config["task"]["name"], LEARNERS.built_in).items():
        assert set(settings) == set(config[section])
        assert all(setting.meaning for setting in settings.values())


def test_the_files_say_the_defaults_of_the_code():
    config = compose(["experiment=reach_avoid"])
    assert {key: config[key] for key in machinery_defaults()} == machinery_defaults()
    assert config["algorithm"] == dataclasses.asdict(AlgorithmConfig()) | dataclasses.asdict(RepsSettings())
    assert config["trials"] == 100
    for name in (*TASKS.built_in, *OUTSIDE):
        entry = TASKS.get(name)
        for group, kind in (("task", entry.config), ("reward", entry.reward)):
            assert yaml.safe_load((CONFIGS / group / f"{name}.yaml").read_text()) == dataclasses.asdict(kind())


def test_what_a_key_is_for():
    assert having(Role.GROWS) == ["cases", "seeds"]
    assert having(Role.MACHINERY) == ["workers", "engine", "runs_dir", "overwrite"]
    assert having(Role.SEARCHED) == ["task", "reward", "algorithm"]
    assert set(result_keys()) == set(KEYS) - set(machinery_defaults())
    assert GROUPS == ("experiment", "task", "reward", "algorithm", "engine")
    assert {path.name for path in CONFIGS.iterdir() if path.is_dir()} == set(GROUPS)
    assert fields_with(Role.GROWS, AlgorithmConfig) == ["iterations"]
    assert fields_with(Role.COMMON, AlgorithmConfig) == [
        "iterations", "samples", "told", "normalise", "keep", "calm", "calm_share", "refine", "policy",
    ]  # fmt: skip


def test_a_path_counts_by_its_name_alone():
    """As `differences` has it, for every key with that role."""
    places = [*having(Role.PLACE)]
    for name in (*TASKS.built_in, *TASKS.described):
        places += [f"task.{field}" for field in fields_with(Role.PLACE, TASKS.get(name).config)]
    assert places == ["spec", "task.file"]
    for place in places:
        before, now = ({place: path} for path in ("here/a.txt", "there/a.txt"))
        assert not differences(before, now)
        assert differences(before, {place: "here/b.txt"})


@pytest.mark.parametrize(
    ("key", "budget"),
    [
        ("seeds", True), ("trials", True), ("algorithm.iterations", True), ("engine.address", True), ("engine", True),
        ("workers", True), ("overwrite", True), ("algorithm.samples", False), ("algorithm", False), ("cases", False),
        ("experiment", False), ("task.steps", False), ("runs_dir", False), ("reward.c2", False), ("nothing", False),
    ],
)  # fmt: skip
def test_what_the_best_candidates_command_leaves_out(key, budget):
    assert is_budget(key, []) == budget


def test_a_learners_own_budget_is_left_out_as_well():
    @dataclasses.dataclass(frozen=True)
    class Own:
        restarts: int = setting("how often it begins again", 1, role=Role.BUDGET)
        width: float = setting("of its steps", 1.0)

    assert is_budget("algorithm.restarts", [Own])
    assert not is_budget("algorithm.restarts", [])
    assert not is_budget("algorithm.width", [Own])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"workers": 0}, "workers: 0 is too small; it must be at least 1"),
        ({"runs_dir": " "}, "runs_dir: it is empty"),
    ],
)
def test_machinery_checks_itself(wrong, message):
    with pytest.raises(UserError, match=message):
        Machinery(**wrong)
