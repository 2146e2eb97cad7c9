"""From what is typed to the config: spellings, plain text, paths."""

import dataclasses
import re
from pathlib import Path

import pytest

from tltlrl.config.compose import OPEN, as_meant, compose
from tltlrl.config.machinery import Machinery
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.registry import TASKS
from tltlrl.resources import SPECS, spec_path, user_path

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("task", ["mjcf", "suite", "gymnasium"])
def test_keys_of_every_mapping_of_a_task_can_be_set_one_by_one(task):
    """Those of `evaluation`, too, which a page need not have."""
    mappings = [field.name for field in dataclasses.fields(TASKS.get(task).config) if "dict" in str(field.type)]
    assert mappings
    assert all(OPEN.match(f"task.{name}.") for name in mappings)


def composed(*overrides):
    return compose([as_meant(override) for override in ("experiment=reach_avoid", *overrides)])


@pytest.mark.parametrize(
    ("typed", "value"),
    [
        ("seeds=[7]", [7]), ("seeds=7", 7), ("seeds=7,8", [7, 8]), ("seeds=7, 8", [7, 8]), ("seeds=7,", [7]),
        ("cases=tltl_episodic", ["tltl_episodic"]), ("cases=a,b", ["a", "b"]), ("cases=[a]", ["a"]),
        ("name=Übung_机器人", "Übung_机器人"), ("name=a=b,c", "a=b,c"), ("name=true", "true"), ("name=a b", "a b"),
        ("name='2024'", "2024"), ("name=it's", "it's"), ("name=\\", "\\"), ("name=(x", "(x"), ("name=7.5", "7.5"),
        ("spec=runs/m,algorithm.epsilon=0.2/specs/s.tltl", "runs/m,algorithm.epsilon=0.2/specs/s.tltl"),
        ("runs_dir=[x]", "[x]"), ("name=${task.name}_2", "reach_avoid_2"),
    ],
)  # fmt: skip
def test_a_value_is_what_its_writer_meant(typed, value):
    assert composed(typed)[typed.partition("=")[0]] == value


@pytest.mark.parametrize(
    ("typed", "given"),
    [
        ("name=a,b", "name=a,b"), ("name=Ü,b", 'name="Ü",b'), ("seeds=7,8", "seeds=7,8"),
        ("name=choice(a,b)", "name=choice(a,b)"), ("cases=tltl_episodic", "cases=[tltl_episodic]"),
        ("cases=a,b", "cases=[a,b]"), ("cases=[a],[b]", "cases=[a],[b]"),
        ("task.signals.tip=s[0:2]", 'task.signals.tip="s[0:2]"'),
        ("task.signals.tip=s,s[0]", 'task.signals.tip=s,"s[0]"'), ("task.signals.tip=[a,b]", "task.signals.tip=[a,b]"),
    ],
)  # fmt: skip
def test_with_several_values_a_comma_separates_them(typed, given):
    assert as_meant(typed, several=True) == given


def test_with_several_values_a_file_whose_name_has_a_comma_is_one(tmp_path):
    path = tmp_path / "a,b=1.tltl"
    path.write_text("x < 1\n")
    assert as_meant(f"spec={path}", several=True) == f'spec="{path}"'


def test_the_home_folder_is_found_where_no_shell_saw_it(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert Machinery(runs_dir="~/x").folder("n") == tmp_path / "x" / "n"
    (tmp_path / "mine.tltl").write_text("signal ee[2]\nspec: F ee.x > 1\n")
    assert spec_path("~/mine.tltl") == tmp_path / "mine.tltl"
    assert user_path("~nobody_of_that_name/x") == Path("~nobody_of_that_name/x")
    study, machinery = read(composed("spec=~/mine.tltl", "runs_dir=~/y", "cases=tltl_episodic"))
    assert study.spec.path == tmp_path / "mine.tltl"
    assert machinery.folder(study.name) == tmp_path / "y" / "reach_avoid"


@pytest.mark.parametrize("page", [p for p in ROOT.rglob("*.md") if not {".venv", "node_modules"} & set(p.parts)])
def test_no_page_has_a_list_that_a_shell_takes_for_its_own(page):
    """zsh answers an unquoted cases=[...] with "no matches found"."""
    for line in page.read_text(encoding="utf-8").splitlines():
        if "tltl" in line:
            assert not re.search(r"""(^|[\s`])[+~]{0,2}[a-z_.]+=\[""", line), line


def test_the_specs_that_come_with_tltlrl_are_found_by_name():
    assert spec_path("toast") == spec_path("toast.tltl") == SPECS / "toast.tltl"


def test_a_robots_page_is_not_listed_by_the_name_that_it_has_inside():
    """A notebook, or a test before this one, may have composed a page in the same process."""
    compose([f"task={ROOT}/examples/reacher/reacher.yaml"])
    with pytest.raises(UserError, match=r"there are: gymnasium, reach_avoid, suite, toast, visit_in_order$"):
        compose(["experiment=reach_avoid", "task=planar"])


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("task.feedbck.shoulder=1", "task.feedbck: no such key; did you mean task."),
        ("reward.stp.goal=2", "reward.stp: no such key; did you mean reward.step?"),
        ("reward.step.gaol=2", "reward.step.gaol: no such key; did you mean goal?"),
        ("task.steps.x=3", "task.steps: Value '{'x': 3}' of type 'mapping' could not be converted to Integer"),
        ("task.steps=[1]", "task.steps: Value '[1]' of type 'list' could not be converted to Integer"),
    ],
)
def test_a_wrong_key_inside_of_a_key_is_told_at_that_key(override, message):
    with pytest.raises(UserError, match=re.escape(message)):
        read(compose(["experiment=reach_avoid", override]))


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("task.evaluation.duration=1", "task.evaluation.duration: it is the same in training and in evaluation"),
        ("task.evaluation.commands=[wrist]", "task.evaluation.commands: it is the same in training and in evaluation"),
        ("task.evaluation.evaluation.x=1", "task.evaluation.evaluation: it is the same in training and in evaluation"),
        ("task.evaluation.modl=x", "task.evaluation.modl: no such key; did you mean model?"),
        ("task.actuators.foo=3", "task.actuators.foo: expected its kind with its gain"),
        ("task.reference=[1]", "task.reference.0: expected hold, or a list of waypoints"),
        ("task.commands.x=1", "task.commands.x: a list has no such part; give the whole list, as KEY=[a,b]"),
        ("task.name.x=1", "task.name: expected the name of a task, not {'x': 1}"),
    ],
)
def test_overrides_of_a_page_are_checked_as_the_page_is(override, message):
    with pytest.raises(UserError, match=re.escape(message)):
        read(compose([f"task={ROOT}/examples/reacher/reacher.yaml", "algorithm.iterations=1", override]))
