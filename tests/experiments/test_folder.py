"""Folders that are not ours are looked at before anything in them is written."""

import os
import stat

import forked
import pytest

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.experiments.experiment import run_experiment
from tltlrl.experiments.multirun import run_combinations


@pytest.fixture
def asked(tmp_path):
    overrides = ["experiment=reach_avoid", "name=mine", f"runs_dir={tmp_path}", "seeds=1", "cases=[tltl_episodic]"]
    return read(compose([*overrides, "overwrite=true"]))


def tree(folder):
    """Everything below it, with content and time."""
    return {
        path: (path.read_bytes() if stat.S_ISREG(path.lstat().st_mode) else b"", os.lstat(path).st_mtime_ns)
        for path in sorted(folder.rglob("*"))
    }


def test_a_folder_of_somebody_elses_stays_as_it_is(asked, tmp_path):
    (tmp_path / "mine").mkdir()
    for name in (".lock", ".film.12.part", "thesis.tex"):
        (tmp_path / "mine" / name).write_text("12")
    before = tree(tmp_path)
    with pytest.raises(UserError, match="exists and holds no results of tltl-run"):
        run_experiment(*asked, [])
    assert tree(tmp_path) == before


@pytest.mark.parametrize("inner", ["specs", "tltl_episodic"])
def test_nothing_is_written_through_a_link_out_of_the_folder(asked, tmp_path, inner):
    (tmp_path / "mine").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "mine" / inner).symlink_to(tmp_path / "elsewhere")
    if inner != "specs":
        study, _ = asked
        import yaml

        (tmp_path / "mine/config.yaml").write_text(yaml.safe_dump(dict(study.settings)))
    before = tree(tmp_path)
    with pytest.raises(UserError, match=f"mine/{inner} is a link, and results are not written through it"):
        run_experiment(*asked, [])
    assert tree(tmp_path) == before


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("+hydra.callbacks.mine={_target_:os.system}", "hydra.callbacks: it names code"),
        ("hydra.job.chdir=true", "hydra.job.chdir: runs_dir would"),
        ("hydra.launcher._target_=os.system", "hydra.launcher._target_=os.system: it names code"),
        ("+hydra.hydra_logging.handlers.mine.class=os.system", "hydra.hydra_logging.handlers.mine.class=os.system: it"),
    ],
)
def test_no_value_of_hydras_own_names_code(override, told, tmp_path):
    started = []
    overrides = ["experiment=reach_avoid", f"runs_dir={tmp_path}", "algorithm.epsilon=0.2,0.5", override]
    with pytest.raises(UserError) as refused:
        run_combinations(overrides, started.append)
    assert told in str(refused.value)
    assert not started


def test_nor_does_an_experiment_of_ones_own(tmp_path):
    own = tmp_path / "mine/experiment/own.yaml"
    own.parent.mkdir(parents=True)
    callback = "hydra:\n  callbacks:\n    mine:\n      _target_: os.system\n      command: touch made\n"
    own.write_text("# @package _global_\ndefaults: [reach_avoid, _self_]\n" + callback)
    started = []
    overrides = [f"hydra.searchpath=[file://{tmp_path}/mine]", "experiment=own", f"runs_dir={tmp_path}"]
    with pytest.raises(UserError, match=r"hydra\.callbacks: it names code"):
        run_combinations([*overrides, "algorithm.epsilon=0.2,0.5"], started.append)
    assert not started
    code, said, errors = forked.tltl_run(tmp_path, "--config-dir", "mine", "experiment=own", "algorithm.iterations=0")
    assert (code, said) == (2, ""), errors  # without -m nothing of hydra: is read
    assert "algorithm.iterations" in errors
    assert not (tmp_path / "made").exists()
