"""Manifests and configs that were changed since they were written: told, and never taken for what was computed."""

import json

import pytest
import yaml

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.experiments.extend import prepare
from tltlrl.experiments.manifest import intact, manifest, put_right, read_manifest, settings_in, start_session


@pytest.fixture
def study(tmp_path):
    """Its folder has a config, a spec and a manifest, as a session begins with."""
    overrides = ["experiment=reach_avoid", "name=mine", "seeds=1", "cases=[tltl_episodic]"]
    study, _ = read(compose([*overrides, f"runs_dir={tmp_path}"]))
    (tmp_path / "mine").mkdir()
    prepare(tmp_path / "mine", study, False)
    made = manifest(study, None, start_session(["tltl-run", *overrides]))
    (tmp_path / "mine/manifest.json").write_text(json.dumps(made))
    return study


def with_epsilon(path, value):
    content = json.loads(path.read_text()) if path.suffix == ".json" else yaml.safe_load(path.read_text())
    (content["config"] if path.suffix == ".json" else content)["algorithm"]["epsilon"] = value
    path.write_text(json.dumps(content))


def test_a_changed_manifest_is_not_repeated_and_the_change_is_told(study, tmp_path):
    path = tmp_path / "mine/manifest.json"
    assert settings_in(path)["algorithm"] == study.settings["algorithm"]
    with_epsilon(path, 0.125)
    with pytest.raises(UserError) as refused:
        settings_in(path)
    assert str(refused.value) == (
        f"{path}: it is not as it was written (algorithm.epsilon: {study.settings['algorithm']['epsilon']} in "
        f"config.yaml, 0.125 now); write changes on the command line, as in --from {path} algorithm.epsilon=0.5, and "
        "put back the file as it was (the experiment's own command does)"
    )


def test_a_changed_manifest_is_put_right_and_the_change_stays_noticed(study, tmp_path):
    path = tmp_path / "mine/manifest.json"
    with_epsilon(path, 0.125)
    changed = read_manifest(path)
    assert intact(changed) is False
    right = put_right(study, changed)
    assert intact(right)
    assert right["config"] == study.settings
    later = manifest(study, right, start_session(["tltl-run"]))
    assert "this file was not as it was written" in later["noticed"][0]


@pytest.mark.usefixtures("study")
def test_a_manifest_without_a_seal_is_one_of_an_earlier_version(tmp_path):
    path = tmp_path / "mine/manifest.json"
    content = json.loads(path.read_text())
    del content["sha256"]
    path.write_text(json.dumps(content))
    assert settings_in(path)["name"] == "mine"


@pytest.mark.parametrize("changed", ["config.yaml", "manifest.json"])
def test_results_are_not_replaced_because_a_file_was_changed_to_what_is_asked_for_now(study, tmp_path, changed):
    folder = tmp_path / "mine"
    with_epsilon(folder / changed, 0.125)
    settings = {**study.settings, "algorithm": {**study.settings["algorithm"], "epsilon": 0.125}}
    other, _ = read(compose(["experiment=reach_avoid"]) | settings)
    before = (folder / "config.yaml").read_text()
    with pytest.raises(UserError, match=r"algorithm\.epsilon: .* there, 0\.125 now"):
        prepare(folder, other, False)
    assert (folder / "config.yaml").read_text() == before
