"""Learned motions made calm: what is kept, what is told, and that it is done to the same bytes."""

import json
import shutil

import numpy as np
import pytest

from tltlrl.cli import main as cli
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.store.run import DamagedError, read_results
from tltlrl.tasks.planar_arm.scene import PlanarArm
from tltlrl.training import calm, session
from tltlrl.training.build import check, set_up
from tltlrl.training.session import calm_policy, learned_policy, train
from tltlrl.training.verdict import judge

ALWAYS = "signal ee[2]\nspec: G ee.y > -9\n"
NEVER = "signal ee[2]\nspec: G ee.y > 9\n"
FIRST = "tltl_episodic/seed_5"


def study(folder, text, *more):
    (folder / "my.tltl").write_text(text)
    settings = [
        "experiment=reach_avoid", f"spec={folder / 'my.tltl'}", "cases=[tltl_episodic]", "seeds=[5]", "trials=3",
        "task.steps=30", "algorithm.iterations=2", "algorithm.samples=4", "algorithm.calm=6",
    ]  # fmt: skip
    return read(compose([*settings, *more]))[0]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A run whose motion was made calm, and its folder."""
    folder = tmp_path_factory.mktemp("calm")
    (run,) = study(folder, ALWAYS).runs()
    train(run, folder / FIRST, lambda _: None)
    return run, folder / FIRST


def test_a_calm_motion_is_judged_like_the_learned_one_and_costs_episodes(done):
    run, folder = done
    results, setup = read_results(folder, run.identity()), set_up(run)
    learned, policy = learned_policy(folder), calm_policy(folder)
    episodes = results["calm"].pop("episodes")
    assert results["calm"] == json.loads(json.dumps(judge(run, setup, policy)))
    assert results["calm"]["robustness_policy"] >= calm.SHARE * results["robustness_policy"]
    before, after = results["motion"], results["calm"]["motion"]
    assert after["acceleration_rms"] < 0.2 * before["acceleration_rms"]
    assert after["path_length"] < before["path_length"]
    assert 2 < episodes <= 2 + 6 * (calm.BATCH + 2 + calm.NOISY)
    np.testing.assert_array_equal(policy.gain, learned.gain)  # the same feedback and exploration about it
    np.testing.assert_array_equal(policy.covariance, learned.covariance)


def test_stopped_while_it_is_made_calm_it_ends_with_the_same_bytes(done, tmp_path, monkeypatch):
    run, folder = done

    def stop(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(session, "calmed", stop)
    with pytest.raises(KeyboardInterrupt):
        train(run, tmp_path / FIRST, lambda _: None)
    monkeypatch.undo()
    assert not (tmp_path / FIRST / "done.json").exists()
    train(run, tmp_path / FIRST, lambda _: None)
    for name in ("progress.csv", "policy.npz", "calm.npz", "done.json"):
        assert (tmp_path / FIRST / name).read_bytes() == (folder / name).read_bytes(), name


@pytest.mark.parametrize("damage", [lambda path: path.unlink(), lambda path: path.write_bytes(b"PK")])
def test_a_damaged_calm_motion_is_seen(done, tmp_path, damage):
    run, folder = done
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    damage(copy / "calm.npz")
    with pytest.raises(DamagedError, match=r"calm\.npz is"):
        read_results(copy, run.identity())


def test_what_violates_its_spec_is_left_as_it_is(tmp_path):
    (run,) = study(tmp_path, NEVER).runs()
    train(run, tmp_path / FIRST, lambda _: None)
    assert read_results(tmp_path / FIRST, run.identity())["calm"] is None
    assert calm_policy(tmp_path / FIRST) is None


def test_without_calm_a_run_is_the_one_that_it_was(tmp_path):
    (plain,), (asked,) = (study(tmp_path, ALWAYS, f"algorithm.calm={n}").runs() for n in (0, 6))
    assert plain.identity() != asked.identity()
    train(plain, tmp_path / FIRST, lambda _: None)
    assert "calm" not in read_results(tmp_path / FIRST, plain.identity())


def test_a_task_that_does_not_name_its_joints_cannot_be_made_calm(tmp_path, monkeypatch):
    asked = study(tmp_path, ALWAYS)
    monkeypatch.setattr(PlanarArm, "joints", None)
    with pytest.raises(UserError, match=r"algorithm\.calm: reach_avoid does not say what its joints are"):
        check(asked)


def test_evaluate_and_summary_show_both(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.tltl").write_text(ALWAYS)
    arguments = [
        "task=reach_avoid", "name=my", "spec=my.tltl", "seeds=1", "trials=2", "task.steps=30", "workers=1",
        "algorithm.iterations=1", "algorithm.samples=4", "algorithm.calm=2",
    ]  # fmt: skip
    assert cli.run(arguments) == 0
    report = (tmp_path / "runs/my/report.md").read_text()
    assert "| tltl_episodic, calm | " in report
    assert "1 of 1 could be, with " in report
    header = (tmp_path / "runs/my/summary.csv").read_text().split("\n")[0].split(",")
    assert {"calm_episodes", "calm_robustness_policy", "calm_successes", "calm_path_length"} < set(header)
    capsys.readouterr()
    with pytest.raises(SystemExit):
        cli.main(["evaluate", "runs/my/tltl_episodic/seed_0", "--trials", "2"])
    first, second = capsys.readouterr().out.split("\nthe calm policy, simplified from it:\n")
    assert first.startswith("the learned policy:\ntrial 0: ")
    for part in (first, second):
        assert "success rate 2/2" in part
        assert "  path_length " in part
