"""Which studies may extend the folder of another."""

import json

import pytest
import yaml

from tltlrl.config.compose import as_meant, compose
from tltlrl.config.keys import machinery_defaults
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.experiments import experiment
from tltlrl.experiments.experiment import run_experiment
from tltlrl.experiments.extend import changes, with_seeds
from tltlrl.experiments.manifest import settings_in
from tltlrl.experiments.results import open_run
from tltlrl.store.files import digest, write_json
from tltlrl.training.study import LATER, with_later


def study(*overrides):
    return read(compose(["task=short_arm", "spec=reach_avoid.tltl", *overrides]))[0]


@pytest.mark.usefixtures("package")
def test_a_case_of_another_learner_extends_a_folder_with_its_own_settings():
    before = study("cases=[tltl_episodic]")
    both = study("cases=[tltl_episodic,tltl_careful]", "seeds=9")
    assert changes(before.settings, both) == ""
    changed = study("cases=[tltl_episodic,tltl_careful]", "seeds=9", "algorithm.caution=0.1")
    assert changes(before.settings, changed) == ""
    assert changes(both.settings, changed) == "  algorithm.caution: 0.5 there, 0.1 now"
    assert "  cases: " in changes(both.settings, before)


@pytest.mark.usefixtures("package")
def test_a_setting_that_a_learner_must_have_had_is_missed():
    before = study("cases=[tltl_careful]")
    damaged = dict(before.settings) | {
        "algorithm": {k: v for k, v in before.settings["algorithm"].items() if k != "caution"}
    }
    assert changes(damaged, before) == "  algorithm.caution: absent there, 0.5 now"
    for nonsense in (None, 3.5, {}):
        assert "  cases: " in changes(dict(before.settings) | {"cases": nonsense}, before)


def test_results_of_before_a_setting_was_added_are_read_and_gone_on_from():
    now = read(compose(["experiment=reach_avoid"]))[0]
    old = {**now.settings, "algorithm": {k: v for k, v in now.settings["algorithm"].items() if k not in LATER}}
    assert changes(old, now) == ""
    again, _ = read(with_later(old) | machinery_defaults())
    assert [run.identity() for run in again.runs()] == [run.identity() for run in now.runs()]
    changed = read(compose(["experiment=reach_avoid", "algorithm.keep=best"]))[0]
    assert changes(old, changed) == "  algorithm.keep: last there, best now"


@pytest.mark.parametrize(
    ("had", "asked", "seeds", "setting"),
    [
        (4, "seeds=2", (0, 1, 2, 3), 4), (2, "seeds=4", (0, 1, 2, 3), 4), ([7, 8], "seeds=[8]", (7, 8), [7, 8]),
        ([7], "seeds=[9]", (7, 9), [7, 9]), (2, "seeds=[9,0]", (0, 1, 9), [0, 1, 9]),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("package")
def test_asking_for_fewer_seeds_or_others_is_no_other_experiment(had, asked, seeds, setting):
    now = study(asked)
    assert changes({**now.settings, "seeds": had}, now) == ""
    whole = with_seeds(now, had)
    assert (whole.seeds, whole.settings["seeds"]) == (seeds, setting)


@pytest.mark.usefixtures("without_pictures")
def test_more_iterations_go_on_and_what_was_not_asked_for_stays(tmp_path, capsys):
    def run(folder, *overrides):
        small = ["experiment=reach_avoid", "name=x", "cases=[tltl_episodic]", "task.steps=12", "algorithm.samples=6"]
        asked = compose([*small, "algorithm.epsilon=0.5", "trials=2", "workers=1", f"runs_dir={folder}", *overrides])
        assert run_experiment(*read(asked), ["test"])
        return capsys.readouterr().err

    run(tmp_path / "a", "seeds=2", "algorithm.iterations=2")
    said = run(tmp_path / "a", "seeds=[1]", "algorithm.iterations=4")
    assert "tltl_episodic seed 1 continues after its 2 iterations" in said
    assert "damaged" not in said
    assert "tltl_episodic: satisfied 0 of 1; robustness -" in said  # seed 0 has fewer iterations
    assert f"report: {tmp_path}/a/x/report.md" in said
    (tmp_path / "a/x/tltl_episodic/seed_0/last.npz").write_bytes(b"")
    said = run(tmp_path / "a", "seeds=2", "algorithm.iterations=4")
    assert "seed 0 has only 2 iterations, and starts again: a run cannot be resumed from its last.npz" in said
    run(tmp_path / "b", "seeds=2", "algorithm.iterations=4")
    a, b = tmp_path / "a/x", tmp_path / "b/x"
    for name in ("learning_curves.csv", "summary.csv", "config.yaml", "tltl_episodic/seed_1/policy.npz"):
        assert (a / name).read_bytes() == (b / name).read_bytes(), name
    assert yaml.safe_load((a / "config.yaml").read_text())["seeds"] == 2
    assert "2 of 2 runs were done" in run(tmp_path / "a", "seeds=2", "algorithm.iterations=4")


@pytest.mark.usefixtures("without_pictures")
def test_what_was_started_from_is_kept_with_the_results(tmp_path, capsys):
    small = ["experiment=reach_avoid", "cases=[tltl_episodic]", "task.steps=12", "algorithm.samples=6", "seeds=1"]

    def study_of(name, *overrides):
        asked = [*small, "trials=2", "workers=1", f"runs_dir={tmp_path}", f"name={name}", *overrides]
        return read(compose([as_meant(override) for override in (*asked, "algorithm.iterations=1", *overrides)]))

    assert run_experiment(*study_of("a"), ["test"])
    learned = tmp_path / "a/tltl_episodic/seed_0/policy.npz"
    assert run_experiment(*study_of("b", f"policy={learned}"), ["test"])
    made = json.loads((tmp_path / "b/manifest.json").read_text())
    assert made["start"] == {str(learned): digest(learned.read_bytes())}
    assert (tmp_path / "b/start.npz").read_bytes() == learned.read_bytes()
    learned.rename(tmp_path / "elsewhere.npz")
    assert open_run(tmp_path / "b/tltl_episodic/seed_0")[0].seed == 0
    assert read(settings_in(tmp_path / "b/manifest.json"))[0].algorithm.policy == str(tmp_path / "b/start.npz")
    capsys.readouterr()
    assert run_experiment(*study_of("b", f"policy={tmp_path}/elsewhere.npz"), ["test"])
    assert "1 of 1 runs were done before" in capsys.readouterr().err
    with pytest.raises(UserError, match="was made from another policy"):
        run_experiment(*study_of("b", f"policy={tmp_path}/b/tltl_episodic/seed_0"), ["test"])


def test_who_computed_what_is_recorded_seldom_and_whole_even_after_ctrl_c(tmp_path, monkeypatch):
    """The manifest lists every run, so that writing it for each of thousands would cost their square."""
    written = []

    def write(path, content):
        if path.name == "manifest.json":
            written.append(content)
        write_json(path, content)

    def stopped(*arguments):
        *_, missing, _, computed = arguments
        for run in missing[:433]:
            computed(run, "a machine")
        raise KeyboardInterrupt

    monkeypatch.setattr(experiment, "write_json", write)
    monkeypatch.setattr(experiment, "compute", stopped)
    asked = compose(["experiment=reach_avoid", "cases=[tltl_episodic]", "seeds=450", f"runs_dir={tmp_path}"])
    with pytest.raises(KeyboardInterrupt):
        run_experiment(*read(asked), ["test"])
    assert len(written) <= experiment.RECORDS + 2
    assert len(json.loads((tmp_path / "reach_avoid/manifest.json").read_text())["computed"]) == 433


@pytest.mark.usefixtures("without_pictures")
def test_a_page_is_named_once_it_is_there(tmp_path, capsys, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    small = ["experiment=reach_avoid", "name=x", "cases=[tltl_episodic]", "task.steps=12", "algorithm.samples=6"]
    asked = compose([*small, "algorithm.iterations=1", "seeds=1", "trials=1", "workers=1", f"runs_dir={tmp_path}"])
    with monkeypatch.context() as patch:
        patch.setattr("tltlrl.experiments.experiment.write_page", stopped)
        with pytest.raises(KeyboardInterrupt):
            run_experiment(*read(asked), ["test"])
    assert "report:" not in capsys.readouterr().err
    assert run_experiment(*read(asked), ["test"])
    assert f"report: {tmp_path}/x/report.md, report.html" in capsys.readouterr().err
