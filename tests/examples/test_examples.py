"""The examples' own commands in small: each trains, and stopped in the middle it ends with the same bytes."""

import re
import shlex
from pathlib import Path

import pytest

from tltlrl.config.compose import as_meant, compose
from tltlrl.config.read import read
from tltlrl.training import session
from tltlrl.training.check import check

ROOT = Path(__file__).parents[2]
SMALL = ("seeds=1", "trials=2", "algorithm.iterations=4", "algorithm.samples=8")
LENGTHS = {
    "ball_in_cup": "task.steps=12",
    "cartpole": "task.duration=2",  # as long as its waypoints last
    "jaco": "task.duration=0.5",
    "mountain_car": "task.steps=12",
    "reacher": "task.duration=0.5",
}


@pytest.mark.parametrize("example", sorted(LENGTHS))
def test_an_example_trains_and_goes_on_where_it_was_stopped(tmp_path, monkeypatch, example):
    if example == "mountain_car":
        pytest.importorskip("gymnasium")
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", 0.0)
    text = (ROOT / "examples" / example / "README.md").read_text(encoding="utf-8").replace("\\\n", " ")
    (command,) = re.findall(r"^    tltl-run (.*)$", text, re.MULTILINE)
    study, _ = read(compose([as_meant(each) for each in (*shlex.split(command), *SMALL, LENGTHS[example])]))
    check(study)
    (run,) = study.runs()

    def stop(iteration):
        if iteration == 3:
            raise KeyboardInterrupt

    session.train(run, tmp_path / "whole", lambda _: None)
    with pytest.raises(KeyboardInterrupt):
        session.train(run, tmp_path / "stopped", stop)
    done = []
    session.train(run, tmp_path / "stopped", done.append)
    assert done == [3, 4]  # from the checkpoint after its second iteration
    for name in ("progress.csv", "clauses.csv", "policy.npz", "done.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
