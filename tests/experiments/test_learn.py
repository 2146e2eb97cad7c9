"""`tltlrl.learn`: a run from code."""

import pytest

import tltlrl
from tltlrl.errors import UserError
from tltlrl.resources import SPECS

SMALL = {"task.steps": 12, "algorithm.samples": 6, "algorithm.epsilon": 0.5, "trials": 2}


@pytest.mark.usefixtures("without_pictures")
def test_it_gives_the_same_bytes_as_the_command(tmp_path):
    from tltlrl.config.compose import compose
    from tltlrl.config.read import read
    from tltlrl.experiments.experiment import run_experiment

    overrides = [f"{key}={value}" for key, value in SMALL.items()]
    asked = ["task=reach_avoid", "seeds=[3]", "algorithm.iterations=2", "workers=1", f"runs_dir={tmp_path}"]
    assert run_experiment(*read(compose([*asked, *overrides])), ["test"])
    learned = tltlrl.learn(task="reach_avoid", iterations=2, seed=3, settings=SMALL, folder=tmp_path / "own")
    for name in ("progress.csv", "policy.npz", "done.json"):
        command = tmp_path / "reach_avoid/tltl_episodic/seed_3" / name
        assert (learned.folder / name).read_bytes() == command.read_bytes(), name
    assert len(learned.curves) == 2
    signals = {name: values[None] for name, values in learned.signals().items()}
    assert learned.run.spec.robustness(signals)[0] == learned.robustness
    assert learned.trials == 2
    for picture in (learned.picture(), learned.curve()):
        assert picture.format == "PNG"
    spec = tltlrl.load_spec(SPECS / "reach_avoid.tltl")  # the same as an object
    again = tltlrl.learn("reach_avoid", spec, iterations=2, seed=3, settings=SMALL)
    assert (again.folder / "done.json").read_bytes() == (learned.folder / "done.json").read_bytes()


def test_mistakes_are_told():
    with pytest.raises(UserError, match=r"algorithm.sampels: no such key; did you mean algorithm.samples\?"):
        tltlrl.learn("reach_avoid", settings={"algorithm.sampels": 3})
    with pytest.raises(UserError, match="no spec file nix"):
        tltlrl.learn("reach_avoid", "nix")
