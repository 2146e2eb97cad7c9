"""From overrides to a study: what is built, what is refused, and tasks and learners of other packages."""

import dataclasses
import functools
import sys
import types

import forked
import pytest
import yaml

from tltlrl.cli import main as cli
from tltlrl.config.compare import differences
from tltlrl.config.compose import compose
from tltlrl.config.keys import having
from tltlrl.config.read import _algorithm, read
from tltlrl.errors import UserError
from tltlrl.settings import Role, setting
from tltlrl.training.study import Case

GROWING = tuple(having(Role.GROWS))
ALONE = ("task=short_arm", "spec=reach_avoid.tltl")


def test_a_study_is_what_the_config_says():
    study, machinery = read(compose(["experiment=visit_in_order", "seeds=[3,1]", "workers=2", "name=2024"]))
    assert (study.name, study.seeds, study.trials) == ("2024", (3, 1), 100)
    assert study.cases[0] == Case("tltl", "episodic")
    assert study.cases[-1] == Case("continuous", "step")
    assert (study.task.name, study.task.steps, study.algorithm.iterations) == ("visit_in_order", 500, 500)
    assert set(study.learners) == {"episodic", "step"}
    assert machinery.workers == 2
    assert machinery.folder(study.name).as_posix() == "runs/2024"
    assert not {"workers", "engine", "runs_dir", "overwrite"} & set(study.settings)
    assert [(run.case.name, run.seed) for run in study.runs()][:3] == [
        ("tltl_episodic", 3), ("tltl_episodic", 1), ("discrete_episodic", 3),
    ]  # fmt: skip


def test_seconds_in_a_spec_are_counted_by_the_tasks_clock(tmp_path):
    def spec_of(text):
        (tmp_path / "task.tltl").write_text(text)
        return read(compose(["task=reach_avoid", f"spec={tmp_path / 'task.tltl'}"]))[0].spec

    spec = spec_of("signal ee[2]\nspec: F[0 s, 8 s] norm(ee) < 1")
    assert spec.period == 0.05
    assert spec.horizon == 160
    assert spec_of("signal ee[2]\nspec: F G norm(ee) < 1").period is None
    with pytest.raises(UserError, match=r"the bound is 0.12 s, and samples are 0.05 s apart"):
        spec_of("signal ee[2]\nspec: F[0, 0.12 s] norm(ee) < 1")
    with pytest.raises(UserError, match=r"the samples are 0.05 s apart, but the spec says 0.1 s"):
        spec_of("period 0.1 s\nsignal ee[2]\nspec: F[0, 1 s] norm(ee) < 1")


@pytest.mark.parametrize("task", ["reach_avoid", "visit_in_order", "toast"])
def test_a_task_alone_is_learned_from_its_spec(task):
    study, _ = read(compose([f"task={task}", "task.steps=80", "algorithm.iterations=3"]))
    assert (study.name, study.task.name, study.task.steps) == (task, task, 80)
    assert [case.name for case in study.cases] == ["tltl_episodic"]
    assert study.spec.path.name == f"{task}.tltl"
    assert study.algorithm.iterations == 3
    by_experiment, _ = read(compose([f"experiment={task}"]))
    assert study.reward == by_experiment.reward


def test_what_is_given_wins_over_what_a_task_alone_stands_for():
    given = ["task=reach_avoid", "name=mine", "cases=[discrete_step]", "reward.goal=3", "spec=reach_avoid"]
    study, _ = read(compose(given))
    assert (study.name, study.cases, study.reward.goal) == ("mine", (Case("discrete", "step"),), 3)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["task=reach_avoyd"], "task=reach_avoyd: there is no such task; did you mean reach_avoid"),
        (["task=reach_avoid", "reward=nothing"], "reward=nothing: there is no such reward"),
        (["task=reach_avoid", "algorithm.sigma=3"], r"algorithm\.sigma: no such key; did you mean algorithm\.basis"),
        (
            ["experiment=reach_avoid", "cases=[tltl_cma]", "algorithm.kept=7"],  # of another learner, and written down
            r"algorithm\.kept: 7.0 is too large",
        ),
        (["experiment=reach_avoid", "cases=[tltl_stepwise]"], "cases: no case is named tltl_stepwise; did you mean"),
        (["experiment=toast", "cases=[discrete_episodic]"], "cases: no case is named discrete_episodic"),
        (["experiment=reach_avoid", "cases=[]"], r"cases: \[\] must name at least one case"),
        (
            ["experiment=reach_avoid", "seeds=0"],
            r"seeds: 0 must be a number n >= 1 for the seeds 0 .. n-1, or a list, as seeds=\[0\]",
        ),
        (["experiment=reach_avoid", "seeds=[a]"], r"seeds: \['a'\] must be a number n >= 1"),
        (["experiment=reach_avoid", "seeds=[[1]]"], r"seeds: \[\[1\]\] must be a number n >= 1"),
        (["experiment=reach_avoid", "seeds=[true]"], r"seeds: \[True\] must be a number n >= 1"),
    ],
)
def test_mistakes(overrides, message):
    with pytest.raises(UserError, match=message):
        read(compose(overrides))


def test_a_whole_config_is_asked_for():
    config = compose(["experiment=reach_avoid"])
    with pytest.raises(UserError, match="trials: missing from the config"):
        read({key: value for key, value in config.items() if key != "trials"})
    with pytest.raises(UserError, match=r"algorithm.feedback: missing from the config"):
        read(config | {"algorithm": {k: v for k, v in config["algorithm"].items() if k != "feedback"}})


@pytest.mark.usefixtures("package")
def test_a_packages_task_has_its_defaults_and_no_file():
    study, _ = read(compose([*ALONE, "task.max_speed=1"]))
    assert (study.name, study.task.name, study.task.steps, study.task.max_speed) == ("short_arm", "short_arm", 12, 1)
    assert study.reward.step == {}


@pytest.mark.usefixtures("package")
def test_a_packages_task_in_an_experiment_of_ones_own(tmp_path, capsys):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text(
        "# @package _global_\ndefaults:\n  - /task: short_arm\n  - /reward: short_arm\nname: mine\n"
        "spec: reach_avoid.tltl\ncases: [tltl_careful]\n"
    )
    assert cli.run(["--config-dir", str(tmp_path), "experiment=mine", "task.steps=9", "--cfg", "job"]) == 0
    assert yaml.safe_load(capsys.readouterr().out)["task"]["steps"] == 9


@pytest.mark.usefixtures("package")
@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["task=short_arm"], "spec: it has no value; give the .tltl file of what is to be learned"),
        (["task=broken", "spec=reach_avoid.tltl"], "the task broken cannot be loaded from nowhere:TASK"),
        (["task=short_amr"], "task=short_amr: there is no such task; did you mean short_arm"),
        ([*ALONE, "cases=[tltl_carefull]"], "cases: no case is named tltl_carefull; did you mean tltl_careful"),
        ([*ALONE, "cases=[tltl_careful]", "algorithm.caution=1"], "algorithm.caution: 1.0 is too large; it must be be"),
        ([*ALONE, "cases=[tltl_careful]", "algorithm.caution=no"], "algorithm.caution: Value 'no'"),
        ([*ALONE, "algorithm.caution=0.2"], r"algorithm\.caution: no such key; did you mean"),
    ],
)
def test_mistakes_with_a_package(overrides, message):
    with pytest.raises(UserError, match=message):
        read(compose(overrides))


def test_a_learners_own_key_may_have_the_name_of_one_of_reps(monkeypatch):
    @dataclasses.dataclass(frozen=True)
    class Own:
        epsilon: float = setting("another bound", 0.5, least=0)

    registry = types.SimpleNamespace(get=lambda _: types.SimpleNamespace(Settings=Own))
    monkeypatch.setattr("tltlrl.config.read.LEARNERS", registry)
    _, found = _algorithm({**compose(["experiment=reach_avoid"])["algorithm"], "epsilon": 0.0}, ["mine"])
    assert found == {"mine": Own(epsilon=0.0)}


@pytest.mark.usefixtures("package")
def test_a_packages_learner_has_settings_of_its_own():
    study, _ = read(compose([*ALONE, "cases=[tltl_careful,tltl_episodic]", "algorithm.caution=0.2"]))
    assert study.learners["careful"].caution == 0.2
    assert study.learners["episodic"].epsilon == 1.0
    assert study.settings["algorithm"]["caution"] == 0.2
    study, _ = read(compose([*ALONE, "cases=[tltl_careful]"]))
    assert study.learners["careful"].caution == study.settings["algorithm"]["caution"] == 0.5


@pytest.mark.usefixtures("package")
def test_help_shows_a_packages_task_and_its_learners_settings(capsys):
    assert cli.run(["task=short_arm", "cases=[tltl_careful]", "--help"]) == 0
    page = capsys.readouterr().out
    assert "Tasks: broken, gymnasium, reach_avoid, short_arm, suite, toast, visit_in_order\n" in page
    assert "    steps: 12                      # samples of one episode\n" in page
    assert "    caution: 0.5                   # how much less it trusts its samples, as a share\n" in page


def test_a_packages_task_and_learner_run_through_tltl_run_with_m_too(tmp_path, package):
    small = [*ALONE, "seeds=2", "trials=2", "workers=1", "algorithm.samples=6", "cases=[tltl_careful]"]
    sweep = ["-m", *small, "algorithm.iterations=1", "algorithm.caution=0.1,0.6"]
    installed = functools.partial(sys.path.insert, 0, str(package))
    code, _, errors = forked.tltl_run(tmp_path, *sweep, first=lambda: (installed(), forked.without_pictures()))
    assert code == 0, errors
    for caution in (0.1, 0.6):
        folder = tmp_path / f"runs/short_arm,algorithm.caution={caution}"
        assert (folder / "tltl_careful/seed_1/done.json").exists()
        assert yaml.safe_load((folder / "config.yaml").read_text())["algorithm"]["caution"] == caution


def test_differences_name_the_keys_and_let_seeds_and_cases_grow():
    before = {"spec": "a/x.tltl", "seeds": 2, "cases": ["a"], "algorithm": {"kept": 0.5}, "constants": {}}
    assert differences(before, before | {"spec": "b/x.tltl", "seeds": [2, 1, 0], "cases": ["b", "a"]}, GROWING) == ""
    assert (
        differences(before, before | {"seeds": [1, 2]}, GROWING) == "  seeds: 2 there, [1, 2] now (they can only grow)"
    )
    more, fewer = (before | {"algorithm": {"kept": 0.5, "iterations": n}} for n in (10**12, 3))
    assert differences(fewer, more, ["algorithm.iterations"]) == ""
    assert differences(more, fewer, ["algorithm.iterations"]) == (
        "  algorithm.iterations: 1000000000000 there, 3 now (they can only grow)"
    )
    assert differences(before, before | {"seeds": [0, 1]}) == "  seeds: 2 there, [0, 1] now"
    changed = before | {"spec": "a/y.tltl", "algorithm": {"kept": 0.6}, "constants": {"r": 1}}
    assert differences(before, changed, GROWING).splitlines() == [
        "  algorithm.kept: 0.5 there, 0.6 now",
        "  constants: {} there, absent now",
        "  constants.r: absent there, 1 now",
        "  spec: x.tltl there, y.tltl now",
    ]
    assert differences(
        before, changed | {"spec": "x.tltl"}, GROWING, ["algorithm.kept", "constants.r"]
    ).splitlines() == [
        "  algorithm.kept: 0.5 there, 0.6 now",
        "  constants: {} there, absent now",
    ]


def test_a_study_made_by_hand_is_checked_as_well():
    study, _ = read(compose(["experiment=reach_avoid"]))
    for wrong in ({"trials": 0}, {"seeds": (1, 1)}, {"seeds": ("a",)}, {"cases": ()}, {"name": "a/b"}):
        with pytest.raises(UserError, match=f"^{next(iter(wrong))}: "):
            dataclasses.replace(study, **wrong)
