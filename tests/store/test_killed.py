"""Killed at any moment and started again, tltl-run ends with the bytes of a run that nothing disturbed.

TLTL_KILLS sets at how many moments in each of three ways (2 with one worker; with two, 1 of the command and 1 of a
worker), TLTL_KILLS_SEED which (0).
"""

import json
import os
import random
import signal
import subprocess
import sys
from pathlib import Path

import forked
import killed
import pytest

KILLS = os.environ.get("TLTL_KILLS")
SETTINGS = (
    "experiment=reach_avoid", "name=small", "seeds=2", "cases=[tltl_episodic,continuous_step]", "trials=3",
    "algorithm.iterations=3", "algorithm.samples=6", "algorithm.epsilon=0.5", "task.steps=30",
)  # fmt: skip
OWN_OF_A_SESSION = (".lock", "timing.csv", "log.txt", "manifest.json", "report.html")  # the page shows the manifest


def tltl_run(folder, workers, who=None, moment=None, number=0):
    """Exit code, what was said, and the moments by process; killed at one of them if one is given."""
    notes = folder / f"notes_{number}"
    notes.mkdir(parents=True)
    conditions = {"who": who, "moment": moment, "notes": str(notes)}
    arguments = [*SETTINGS, f"workers={workers}"]
    if workers == 1:
        code, _, errors = forked.tltl_run(
            folder, *arguments, first=lambda: (killed.install(**conditions, role="command"), drawing())
        )
    else:
        code, errors = spawned(folder, conditions, arguments)
    moments = {path.name.partition(".")[0]: path.read_text().splitlines() for path in notes.glob("*.*")}
    return code, errors, moments, (notes / "killed").exists()


def drawing():
    """Of how files are written, painting is no part; at large the pictures are real."""
    if not KILLS:
        forked.with_sketches()


def spawned(folder, conditions, arguments):
    environment = os.environ if KILLS else forked.sketched()
    done = subprocess.run(
        [sys.executable, Path(__file__).with_name("killed.py"), *arguments],
        cwd=folder, env=environment | {"TLTL_KILLED": json.dumps(conditions)}, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr


def result(folder):
    """Every file of the experiment, with its content where that must be the same on every repeat."""
    files = [path for path in sorted((folder / "runs/small").rglob("*")) if path.is_file()]
    return {
        str(path.relative_to(folder)): None if path.name in OWN_OF_A_SESSION else path.read_bytes() for path in files
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    code, errors, moments, _ = tltl_run(folder, 1)
    assert code == 0, errors
    return result(folder), moments["command"]


def chosen(moments, count):
    """Numbers of `count` moments: of as many kinds (what is done to which file) as there are, then again."""
    rng = random.Random(int(os.environ.get("TLTL_KILLS_SEED", "0")))
    kinds = {}
    for number, moment in enumerate(moments):
        kinds.setdefault(moment.replace("seed_0", "seed_1"), []).append(number)
    order = rng.sample(sorted(kinds), len(kinds))
    return [rng.choice(kinds[order[i % len(order)]]) for i in range(count)]


def of_workers(moment):
    folders = ("make small/tltl_episodic", "make small/continuous_step")
    return "seed_" in moment or moment == "compute iteration" or moment in folders


def test_one_worker(undisturbed, tmp_path):
    expected, moments = undisturbed
    for number in chosen(moments, int(KILLS or 2)):
        folder = tmp_path / str(number)
        code, _, listed, was_killed = tltl_run(folder, 1, "command", number)
        assert was_killed
        assert code == -signal.SIGKILL
        assert listed["command"][-1] == moments[number]
        code, errors, _, _ = tltl_run(folder, 1, number=1)
        assert code == 0, (moments[number], errors)
        assert result(folder) == expected, moments[number]
        print("one worker, killed before or in:", moments[number])


@pytest.mark.parametrize("who", ["command", "worker"])
def test_two_workers(undisturbed, tmp_path, who):
    expected, moments = undisturbed
    own = [moment for moment in moments if of_workers(moment) == (who == "worker")]
    own = own[: len(own) // 4] if who == "worker" else own  # surely in the first of the four runs
    for number in chosen(own, int(KILLS or 1)):
        folder = tmp_path / str(number)
        code, errors, _, was_killed = tltl_run(folder, 2, who, number)
        assert was_killed
        assert "Traceback" not in errors, errors
        if who == "command":
            assert code == -signal.SIGKILL
            code, errors, _, _ = tltl_run(folder, 2, number=1)
        assert code == 0, (own[number], errors)
        assert result(folder) == expected, own[number]
        print(f"two workers, {who} killed before or in:", own[number])
