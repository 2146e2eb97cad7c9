"""tltl-run as its users meet it: a whole small experiment, and every mistake told."""

import contextlib
import csv
import io
import itertools
import json
import os
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import forked
import psutil  # of distributed
import pytest
import yaml

import tltlrl
from tltlrl.cli import main as cli
from tltlrl.experiments import manifest
from tltlrl.resources import SPECS

EXPERIMENTS = (
    "reach_avoid, reach_avoid_best, toast, toast_best, toast_line, toast_rest, visit_in_order, visit_in_order_best"
)
SMALL = (
    "experiment=reach_avoid",
    "name=small",
    "seeds=2",
    "cases=[tltl_episodic,discrete_step]",
    "algorithm.iterations=3",
    "algorithm.samples=8",
    "algorithm.epsilon=0.5",
    "task.steps=40",
    "trials=5",
)
CASES = ("tltl_episodic", "discrete_step")  # one learner each; all five run in test_readme.py


def contents(folder, *patterns):
    """The bytes of every file that must be the same on every repeat."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for pattern in ("**/progress.csv", "**/policy.npz", "**/done.json", "*.csv", *patterns)
        for path in sorted(folder.glob(pattern))
    }


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The folder of the small experiment, computed in one process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    code, _, errors = run(folder, *SMALL, "workers=1", first=forked.with_sketches)
    assert code == 0, errors
    return folder / "runs" / "small"


def run(folder, *arguments, first=forked.without_pictures):
    if "workers=2" not in arguments:
        return forked.tltl_run(folder, *arguments, first=first)
    done = subprocess.run(
        [*launcher(), *arguments], cwd=folder, env=forked.sketched(), capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def launcher():
    return [sys.executable, "-c", "import sys; sys.argv[0] = 'tltl-run'\nif __name__ == '__main__':\n"
            "    from tltlrl.cli.main import run_main\n    run_main()"]  # fmt: skip


def test_the_folder_of_a_finished_experiment(undisturbed):
    expected = {"config.yaml", "manifest.json", "learning_curves.csv", "summary.csv", "summary.md", "report.md"}
    assert expected | {"learning_curves.png", "learning_curves.pdf", "clauses.png", "clauses.pdf", "log.txt"} <= {
        p.name for p in undisturbed.iterdir()
    }
    assert (undisturbed / "specs" / "reach_avoid.tltl").exists()
    for case in CASES:
        assert {p.name for p in (undisturbed / case).iterdir() if p.is_file()} == {"workspace.png", "workspace.pdf"}
        for seed in (0, 1):
            run_folder = undisturbed / case / f"seed_{seed}"
            files = {"progress.csv", "clauses.csv", "timing.csv", "policy.npz", "done.json", "last.npz"}
            assert {p.name for p in run_folder.glob("[!.]*")} == files


def test_learning_curves_have_the_promised_columns_and_rows(undisturbed):
    with open(undisturbed / "learning_curves.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    promised = """task case reward algorithm seed iteration episodes env_steps return_mean robustness_mean
        robustness_std robustness_min robustness_max robustness_policy satisfied_fraction eta kl effective_sample_size
        entropy"""
    assert set(promised.split()) <= set(rows[0])
    assert [(r["case"], int(r["seed"]), int(r["iteration"])) for r in rows] == [
        (case, seed, i) for case in CASES for seed in (0, 1) for i in range(3)
    ]
    assert [int(r["episodes"]) for r in rows[:3]] == [8, 16, 24]
    assert [int(r["env_steps"]) for r in rows[:3]] == [8 * 40, 16 * 40, 24 * 40]
    for row in rows:
        assert float(row["robustness_min"]) <= float(row["robustness_mean"]) <= float(row["robustness_max"])
        assert float(row["kl"]) <= 0.5 + 1e-6
        if row["reward"] == "tltl":
            assert row["return_mean"] == row["robustness_mean"]
    # The first iteration has the same noise in every case, so the same trajectories and robustness.
    first = [r["robustness_mean"] for r in rows if r["iteration"] == "0" and r["seed"] == "0"]
    assert len(set(first)) == 1


def test_summary_has_the_success_rate_of_the_trials(undisturbed):
    with open(undisturbed / "summary.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    for row in rows:
        assert int(row["trials"]) == 5
        assert float(row["success_rate"]) == int(row["successes"]) / 5


def test_manifest_says_what_it_was_made_with(undisturbed):
    made = json.loads((undisturbed / "manifest.json").read_text())
    assert {"mujoco", "dm-control", "numpy"} <= set(made["packages"])
    assert made["command"][0] == "tltl-run"
    assert re.fullmatch("[0-9a-f]{64}", made["specs"]["reach_avoid.tltl"])
    assert made["ended"] >= made["started"]
    assert made["python"] == platform.python_version()
    assert made["platform"] == platform.platform()
    assert made["cpu"]["count"] == os.cpu_count()
    assert made["cpu"]["model"]


def test_the_commit_is_that_of_this_code_and_of_no_project_around_it(tmp_path, monkeypatch):
    def git(*arguments):
        command = ["git", "-c", "user.name=a", "-c", "user.email=a@b", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.strip()

    code = tmp_path / "venv/tltlrl/manifest.py"
    code.parent.mkdir(parents=True)
    code.write_text("")
    git("init")
    git("commit", "--allow-empty", "-m", "another project")
    monkeypatch.setattr(manifest, "__file__", str(code))
    assert manifest.start_session([])["git"] is None
    git("add", ".")
    assert manifest.start_session([])["git"] == {"commit": git("rev-parse", "HEAD"), "dirty": True}
    git("commit", "-m", "this code")
    assert manifest.start_session([])["git"] == {"commit": git("rev-parse", "HEAD"), "dirty": False}


def test_a_manifest_repeats_its_experiment(undisturbed, tmp_path):
    code, _, errors = run(tmp_path, "--from", str(undisturbed / "manifest.json"), f"runs_dir={tmp_path}/again")
    assert code == 0, errors
    assert contents(tmp_path / "again" / "small") == contents(undisturbed)
    code, _, errors = run(tmp_path, "--from", str(undisturbed / "manifest.json"))
    assert code == 0
    assert "4 of 4 runs were done before and are kept" in errors


def test_a_manifest_says_nothing_about_what_is_deleted_or_whom_to_connect_to(undisturbed, tmp_path):
    """A forged one names a victim's folder, wants it emptied, and points to a scheduler."""
    shutil.copytree(undisturbed, tmp_path / "runs/victim")
    (tmp_path / "runs/victim/notes.txt").write_text("mine")
    (tmp_path / "runs/got").mkdir()
    forged = json.loads((undisturbed / "manifest.json").read_text())
    forged["config"] |= {
        "name": "victim", "overwrite": True, "engine": {"address": "tcp://127.0.0.1:9"}, "runs_dir": "/nowhere",
        "trials": forged["config"]["trials"] + 1,
    }  # fmt: skip
    del forged["sha256"]
    (tmp_path / "runs/got/manifest.json").write_text(json.dumps(forged))
    code, _, errors = run(tmp_path, "--from", "runs/got/manifest.json")
    assert code == 2
    assert f"{tmp_path}/runs/victim holds results of another config" in errors
    assert (tmp_path / "runs/victim/notes.txt").read_text() == "mine"
    _, shown, _ = run(tmp_path, "--from", "runs/got/manifest.json", "--cfg", "job")
    assert "address: null" in shown
    assert "overwrite: false" in shown


def test_a_manifest_goes_on_in_its_own_folder_wherever_its_spec_lay(tmp_path):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    (here / "my.tltl").write_text((SPECS / "reach_avoid.tltl").read_text())
    small = (*SMALL, "cases=[tltl_episodic]", "workers=1", "spec=my.tltl")
    assert run(here, *small, "seeds=1")[0] == 0
    (here / "my.tltl").write_text("spec: F x < 1\n")
    code, _, errors = run(there, "--from", "../here/runs/small/manifest.json", "seeds=2")
    assert code == 0, errors
    assert "1 of 2 runs were done before and are kept" in errors


def test_whoever_stops_reading_the_messages_stops_nothing(tmp_path):
    reading, writing = os.pipe()
    os.close(reading)
    arguments = [*launcher(), *SMALL, "cases=[tltl_episodic]", "workers=1"]
    done = subprocess.run(arguments, cwd=tmp_path, env=forked.sketched(), stderr=writing, timeout=60, check=False)
    assert done.returncode == 0
    os.close(writing)
    assert (tmp_path / "runs/small/summary.csv").exists()


@pytest.mark.parametrize("arguments", [("--from",), ("--from", "nothing.json"), ("--from", "{here}/config.yaml")])
def test_what_is_no_manifest_is_told(undisturbed, tmp_path, arguments):
    code, _, errors = run(tmp_path, *(argument.format(here=undisturbed) for argument in arguments))
    assert code == 2
    assert errors.startswith("tltl-run: ")
    assert "manifest.json" in errors
    assert len(errors.splitlines()) == 1


def test_two_workers_write_the_same_bytes(undisturbed, tmp_path):
    code, _, errors = run(tmp_path, *SMALL, "workers=2")
    assert code == 0, errors
    assert contents(tmp_path / "runs" / "small") == contents(undisturbed)


def test_the_same_command_again_does_nothing_and_says_so(undisturbed):
    before = contents(undisturbed)
    pictures = {path: path.stat().st_mtime_ns for path in undisturbed.glob("*/workspace.*")}
    code, _, errors = run(undisturbed.parents[1], *SMALL, "workers=1", first=forked.with_sketches)
    assert code == 0
    assert "4 of 4 runs were done before and are kept" in errors
    assert contents(undisturbed) == before
    assert len(pictures) == 4
    assert pictures == {path: path.stat().st_mtime_ns for path in pictures}


def test_a_picture_that_is_missing_is_drawn_again(undisturbed):
    picture = undisturbed / "tltl_episodic/workspace.pdf"
    before = picture.read_bytes()
    picture.unlink()
    code, _, errors = run(undisturbed.parents[1], *SMALL, "workers=1", first=forked.with_sketches)
    assert code == 0, errors
    assert picture.read_bytes() == before


def started(folder, *arguments):
    """The command as a terminal's foreground job, its messages in said.txt."""
    with open(folder / "said.txt", "w") as file:
        return subprocess.Popen(
            [*launcher(), *arguments],
            cwd=folder,
            env=forked.sketched(),
            stderr=file,
            start_new_session=True,
            # A background job's children inherit that Ctrl-C is ignored.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )


def wait_until(condition, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition():  # once is enough: what it saw may be gone the next moment
        assert time.monotonic() < deadline
        time.sleep(0.01)


def workers_of(process):
    """Whether a process has started workers; it has other children too, that ask git for the commit."""
    found = False
    for child in psutil.Process(process.pid).children():
        with contextlib.suppress(psutil.Error):  # already gone
            found |= "multiprocessing" in " ".join(child.cmdline())
    return found


def stop(process, kill, said):
    """Ctrl-C or kill -9; the command and all that it started must end."""
    descendants = psutil.Process(process.pid).children(recursive=True)
    since = time.monotonic()
    # As a terminal does, Ctrl-C goes to the whole group; kill -9 to the one process.
    os.killpg(process.pid, kill) if kill == signal.SIGINT else os.kill(process.pid, kill)
    process.wait(timeout=20)
    if kill == signal.SIGINT:
        assert time.monotonic() - since < 10  # 1 s on a machine with nothing else to do
        assert process.returncode == 130, said.read_text()
        assert said.read_text().endswith("tltl-run: stopped; the same command continues from what is done\n")
        assert "Traceback" not in said.read_text()
    wait_until(lambda: not any(d.is_running() and d.status() != psutil.STATUS_ZOMBIE for d in descendants), 10)
    return descendants


@pytest.mark.parametrize("kill", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("workers", [1, 2])
def test_stopped_in_the_middle_the_same_command_ends_with_the_same_bytes(undisturbed, tmp_path, kill, workers):
    process = started(tmp_path, *SMALL, f"workers={workers}")
    wait_until(lambda: list(tmp_path.glob("runs/small/*/*/done.json")))
    descendants = stop(process, kill, tmp_path / "said.txt")
    assert len(descendants) >= (workers if workers > 1 else 0)
    code, _, errors = run(tmp_path, *SMALL, "workers=1")
    assert code == 0, errors
    assert contents(tmp_path / "runs" / "small") == contents(undisturbed)


@pytest.mark.parametrize("kill", [signal.SIGKILL, signal.SIGINT])
def test_stopped_while_its_workers_start_it_ends_with_them(tmp_path, kill):
    process = started(tmp_path, *SMALL, "workers=2")
    wait_until(lambda: workers_of(process))
    stop(process, kill, tmp_path / "said.txt")


def test_more_seeds_extend_a_folder(undisturbed, tmp_path):
    code, _, _ = run(tmp_path, *SMALL, "seeds=[0]", "workers=1")
    assert code == 0
    code, _, errors = run(tmp_path, *SMALL, "workers=1")
    assert code == 0
    assert "2 of 4 runs were done before and are kept" in errors
    assert contents(tmp_path / "runs" / "small") == contents(undisturbed)


def test_another_config_in_an_existing_folder_is_refused_with_the_difference(undisturbed):
    before = contents(undisturbed, "config.yaml")
    code, _, errors = run(undisturbed.parents[1], *SMALL, "algorithm.epsilon=0.6")
    assert code == 2
    assert "algorithm.epsilon: 0.5 there, 0.6 now" in errors
    assert "overwrite=true" in errors
    assert contents(undisturbed, "config.yaml") == before


def test_overwrite_starts_again(tmp_path):
    code, _, _ = run(tmp_path, *SMALL, "seeds=[0]", "cases=[tltl_episodic]", "workers=1")
    assert code == 0
    code, _, errors = run(tmp_path, *SMALL, "seeds=[1]", "cases=[tltl_episodic]", "workers=1", "overwrite=true")
    assert code == 0, errors
    assert [p.name for p in (tmp_path / "runs" / "small" / "tltl_episodic").glob("seed_*")] == ["seed_1"]


@pytest.mark.parametrize("workers", [1, 2])
def test_a_run_that_fails_is_told_the_others_go_on_and_the_exit_code_is_1(tmp_path, workers):
    """The root has no value below a height that some seeds' first samples reach and others' do not."""
    (tmp_path / "root.tltl").write_text("signal ee[2]\nconst low = 1.9\nspec: F G (sqrt(ee.y - low) > 0.3)\n")
    settings = ("spec=root.tltl", "cases=[tltl_episodic]", "seeds=6", "algorithm.iterations=1", "task.steps=8")
    code, _, errors = run(tmp_path, *SMALL, *settings, f"workers={workers}")
    failed, finished = errors.count("FAILED: TraceError"), errors.count(" finished\n")
    assert code == 1, errors
    assert failed + finished == 6
    assert failed > 0
    assert finished > 0
    assert "Traceback" not in errors
    page = (tmp_path / "runs/small/summary.md").read_text()
    assert page.count("- tltl_episodic/seed_") == failed
    assert len((tmp_path / "runs/small/summary.csv").read_text().splitlines()) == 1 + finished


def test_a_rerun_leaves_the_manifest_of_those_who_computed(undisturbed):
    before = (undisturbed / "manifest.json").read_text()
    assert run(undisturbed.parents[1], *SMALL, "workers=1")[0] == 0
    assert (undisturbed / "manifest.json").read_text() == before


def test_a_session_that_adds_runs_is_added_to_the_manifest(tmp_path):
    small = (*SMALL, "cases=[tltl_episodic]", "workers=1")
    assert run(tmp_path, *small, "seeds=1")[0] == 0
    first = json.loads((tmp_path / "runs/small/manifest.json").read_text())
    assert run(tmp_path, *small, "seeds=2")[0] == 0
    made = json.loads((tmp_path / "runs/small/manifest.json").read_text())
    assert (made["command"], made["started"]) == (first["command"], first["started"])
    assert [session["command"][-1] for session in made["later_sessions"]] == ["seeds=2"]


@pytest.mark.parametrize("overwrite", ["true", "false"])
@pytest.mark.parametrize("name", ["config.yaml", "precious.txt"])
def test_a_folder_that_is_not_ours_is_neither_written_nor_deleted(tmp_path, name, overwrite):
    (tmp_path / "runs/small").mkdir(parents=True)
    (tmp_path / "runs/small" / name).write_text("name: mine\n")
    code, _, errors = run(tmp_path, *SMALL, f"overwrite={overwrite}")
    assert code == 2
    assert "exists and holds no results of tltl-run" in errors
    assert [path.name for path in tmp_path.glob("runs/small/[!.]*")] == [name]


MISTAKES = {
    (): f"tltl-run: say which experiment: experiment=NAME, one of: {EXPERIMENTS}",
    ("experiment=reach_avoyd",): (
        "tltl-run: experiment=reach_avoyd: there is no such experiment; did you mean reach_avoid?"
    ),
    ("experiment=reach_avoid", "algorithm.sampels=3"): (
        "tltl-run: algorithm.sampels: no such key; did you mean algorithm.samples?"
    ),
    ("experiment=reach_avoid", "sedes=3"): "tltl-run: sedes: no such key; did you mean seeds?",
    ("experiment=reach_avoid", "+sedes=3"): "tltl-run: sedes: no such key; did you mean seeds?",
    ("experiment=reach_avoid", "xyzzy=3"): (  # of its own section alone, and not of every one
        "tltl-run: xyzzy: no such key; there are: algorithm, cases, constants, engine, experiment, name, overwrite, "
        "reward, runs_dir, seeds, spec, task, trials, workers"
    ),
    ("experiment=reach_avoid", "task.control_timestep=0.013"): (
        "tltl-run: task.control_timestep: no such key; there are: task.command_noise, task.link_lengths, "
        "task.max_speed, task.name, task.start_angles, task.steps"
    ),
    ("experiment=reach_avoid", "+algorithm.sampels=3"): (
        "tltl-run: algorithm.sampels: no such key; did you mean algorithm.samples?"
    ),
    ("experiment=reach_avoid", "algorithm.samples=many"): (
        "tltl-run: algorithm.samples: Value 'many' of type 'str' could not be converted to Integer"
    ),
    ("experiment=reach_avoid", "algorithm.samples=1"): (
        "tltl-run: algorithm.samples: 1 is too small; it must be at least 2"
    ),
    ("experiment=reach_avoid", "algorithm.epsilon=3.5"): (
        "tltl-run: algorithm.epsilon: 3.5 must lie between 0 and log(algorithm.samples) = 2.996: the weights of 20 "
        "samples cannot be further from uniform. Lower it, or draw more samples."
    ),
    ("experiment=reach_avoid", "algorithm.epsilon=nan"): (
        "tltl-run: algorithm.epsilon: nan is not a finite number"
    ),
    ("experiment=reach_avoid", "algorithm.covariance=dampd"): (
        "tltl-run: algorithm.covariance: there is no dampd; did you mean damped?"
    ),
    ("experiment=reach_avoid", "cases=[tltl_stepwise]"): (
        "tltl-run: cases: no case is named tltl_stepwise; did you mean tltl_step?"
    ),
    ("experiment=reach_avoid", "seeds=[1,1]"): (
        "tltl-run: seeds: [1, 1] must be a number n >= 1 for the seeds 0 .. n-1, or a list of different numbers >= 0"
    ),
    ("experiment=reach_avoid", "seeds=four"): "tltl-run: seeds: expected int or list, not 'four'",
    ("experiment=reach_avoid", "seeds=[1"): (
        "tltl-run: seeds=[1: not readable as key=value; a list is written [1,2,3], text with special characters in "
        "quotes: key='\"a b\"'"
    ),
    ("experiment=reach_avoid", "workers=0"): "tltl-run: workers: 0 is too small; it must be at least 1",
    ("experiment=reach_avoid", "task=planar"): (
        "tltl-run: task=planar: there is no such task; there are: gymnasium, reach_avoid, suite, toast, visit_in_order"
    ),
    ("experiment=reach_avoid", "task.link_lengths=[1,1]"): (
        "tltl-run: task.link_lengths: [1.0, 1.0] must be three positive lengths, m"
    ),
    ("experiment=reach_avoid", "task.steps=-3"): (
        "tltl-run: task.steps: -3 is too small; it must be at least 2"
    ),
    ("experiment=reach_avoid", "task.command_noise=-1"): (
        "tltl-run: task.command_noise: -1.0 is too small; it must be at least 0"
    ),
    ("experiment=reach_avoid", "seeds=3000000000000000000000"): (
        "tltl-run: seeds: 3000000000000000000000 are too many; at most 10000, or a list of the seeds themselves"
    ),
    ("experiment=visit_in_order", "reward=reach_avoid"): (
        "tltl-run: reward.wrong_order: missing from the config; is reward the one of this experiment?"
    ),
    ("experiment=reach_avoid", "+reward.step.c9=1"): (
        "tltl-run: reward.step.c9: no such key; there are: c1, c2, goal, obstacle"
    ),
    ("experiment=reach_avoid", "engine.address=nonsense"): (
        "tltl-run: engine.address: no scheduler answers at nonsense (it must be tcp://HOST:PORT or tls://HOST:PORT); "
        "start one with `dask scheduler`, or leave it out"
    ),
    ("experiment=reach_avoid", "spec=reach_avoit.tltl"): (
        f"tltl-run: no spec file reach_avoit.tltl here or in {SPECS}; did you mean reach_avoid.tltl?"
    ),
    ("experiment=reach_avoid", "name=a/b"): "tltl-run: name: 'a/b' cannot be a folder's name",
    ("experiment=reach_avoid", "runs_dir="): (
        "tltl-run: runs_dir: it is empty; give the folder above the experiments' folders, or . for this one"
    ),
    ("experiment=reach_avoid", "trials=1000000000"): (
        "tltl-run: trials: 1000000000 is too large; it must be at most 10000"
    ),
    ("experiment=reach_avoid", "algorithm.samples=10001"): (
        "tltl-run: algorithm.samples: 10001 is too large; it must be at most 10000"
    ),
    ("experiment=reach_avoid", "task.steps=100001"): (
        "tltl-run: task.steps: 100001 is too large; it must be at most 100000"
    ),
    ("reach_avoid",): "tltl-run: reach_avoid: did you mean experiment=reach_avoid?",
    ("help",): "tltl-run: help: did you mean --help?",
    ("experiment=3",): (
        f"tltl-run: experiment=3: there is no such experiment; there are: {EXPERIMENTS}"
    ),
    ("experiment=null",): (
        f"tltl-run: experiment=null: there is no such experiment; there are: {EXPERIMENTS}"
    ),
    ("~experiment",): (
        "tltl-run: name: it has no value; experiment=NAME gives it one (a file of your own for that begins with the "
        "line `# @package _global_`)"
    ),
    ("experiment=reach_avoid", "reward=null"): (
        "tltl-run: reward=null: there is no such reward; there are: gymnasium, reach_avoid, suite, toast, "
        "visit_in_order"
    ),
    ("experiment=reach_avoid", "algorithm={a:1}"): (
        "tltl-run: algorithm={a:1}: there is no such algorithm; there are: reps"
    ),
    ("experiment=reach_avoid", "constants=[1]"): (
        "tltl-run: constants=[1]: this key cannot have such a value; --cfg job shows the one it has"
    ),
    ("experiment=reach_avoid", "task.link_lengths=1,2"): (
        "tltl-run: task.link_lengths=1,2: a list is written 'task.link_lengths=[1,2]'; several experiments with -m "
        "(see --help)"
    ),
    ("experiment=reach_avoid,toast",): (
        "tltl-run: experiment=reach_avoid,toast: these are several experiments; write -m experiment=reach_avoid,toast"
    ),
    ("experiment=reach_avoid", "seed=7"): (
        "tltl-run: seed: no such key; write 'seeds=[7]' for the seed 7 alone; seeds=7 is how many, from 0 on"
    ),
    ("experiment=reach_avoid", "--seed=7"): (
        "tltl-run: --seed: no such option; write 'seeds=[7]' for the seed 7 alone; seeds=7 is how many, from 0 on"
    ),
    ("experiment=reach_avoid", "name=${nothing}"): "tltl-run: Interpolation key 'nothing' not found",
    ("experiment=reach_avoid", "--seeds", "3"): (
        "tltl-run: --seeds: no such option; write 'seeds=[3]' for the seed 3 alone; seeds=3 is how many, from 0 on"
    ),
    ("--algorithm.samples=3", "experiment=reach_avoid"): (
        "tltl-run: --algorithm.samples: no such option; write algorithm.samples=3 (see --help)"
    ),
    ("experiment=reach_avoid", "--resume"): (
        "tltl-run: --resume: no such option; there are: --from, --cfg, -m, --config-dir, --version, --help"
    ),
    ("experiment=reach_avoid", "--config", "mine"): (
        "tltl-run: --config: no such option; there are: --from, --cfg, -m, --config-dir, --version, --help"
    ),
    ("experiment=reach_avoid", "--cfg", "jobs"): (
        "tltl-run: --cfg jobs: it can only be --cfg job"
    ),
    ("--config-dir", "mine", "experiment=reach_avoid"): "tltl-run: --config-dir mine: there is no such folder",
    ("--from", "manifest.json", "-m"): (
        "tltl-run: --from: it repeats one experiment, as its manifest says; leave out -m and --config-dir"
    ),
    # With -m every combination is looked at before the first one starts.
    ("-m", "experiment=reach_avoid", "algorithm.samples=30", "algorithm.epsilon=0.2,9"): (
        "tltl-run: algorithm.epsilon: 9.0 must lie between 0 and log(algorithm.samples) = 3.401: the weights of 30 "
        "samples cannot be further from uniform. Lower it, or draw more samples."
    ),
    ("experiment=reach_avoid,toast", "-m", "task.max_speed=1"): (
        "tltl-run: task.max_speed: no such key; did you mean task.name?"
    ),
    ("experiment=reach_avoid", "-m", "algorithm.epsilon=interval(0,1)"): (
        "tltl-run: algorithm.epsilon=interval(0,1): -m needs single values, as in algorithm.epsilon=0.2,0.5 or "
        "range(1,4)"
    ),
    ("experiment=reach_avoid", "-m", "cases=[tltl_episodic],[discrete_step]"): (
        "tltl-run: -m: two combinations have the same folder runs/reach_avoid; sweep what makes them different "
        "experiments (one experiment takes lists of cases and seeds, as in seeds=[1,2]), or name, too"
    ),
    ("experiment=reach_avoid", "-m", "--cfg", "job"): (
        "tltl-run: --cfg job: it shows the config of one experiment; leave out -m"
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """What the command says to each mistake, all in one process: (exit code, stdout, stderr, files written)."""
    folder = tmp_path_factory.mktemp("mistakes")

    def tell(_):
        results = []
        for arguments in MISTAKES:
            out, err = io.StringIO(), io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = cli.run(list(arguments))
            results.append((code, out.getvalue(), err.getvalue(), os.listdir()))
        print(json.dumps(results))

    code, printed, errors = forked.run("tltl-run", tell, folder)
    assert code == 0, errors
    return dict(zip(MISTAKES, json.loads(printed), strict=True))


@pytest.mark.parametrize("arguments", MISTAKES, ids=" ".join)
def test_a_mistake_is_one_message_exit_code_2_and_nothing_written(told, arguments):
    assert told[arguments] == [2, "", MISTAKES[arguments] + "\n", []]


def test_a_mistake_through_the_real_command(tmp_path):
    assert run(tmp_path, "experiment=reach_avoid", "sedes=3") == (
        2, "", "tltl-run: sedes: no such key; did you mean seeds?\n"
    )  # fmt: skip
    assert list(tmp_path.iterdir()) == []


def test_multirun_gives_every_combination_a_folder_that_is_found_again(tmp_path):
    few = [setting for setting in SMALL if not setting.startswith(("seeds", "algorithm.epsilon"))]
    small = (*few, "cases=[tltl_episodic]", "workers=1", "algorithm.epsilon=0.4,0.5")
    folders = ["small,algorithm.epsilon=0.4", "small,algorithm.epsilon=0.5"]
    code, _, errors = run(tmp_path, "-m", *small, "seeds=1")
    assert code == 0, errors
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == folders
    code, _, errors = run(tmp_path, *small, "-m", "seeds=2", "trials=5")
    assert code == 0, errors
    assert errors.count("1 of 2 runs were done before and are kept") == 2
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == folders
    for folder, epsilon in zip(folders, (0.4, 0.5), strict=True):
        settings = yaml.safe_load((tmp_path / "runs" / folder / "config.yaml").read_text())
        assert (settings["name"], settings["algorithm"]["epsilon"], settings["seeds"]) == (folder, epsilon, 2)
        assert (tmp_path / "runs" / folder / "summary.csv").exists()


def test_a_combination_that_fails_lets_the_others_go_on(tmp_path):
    (tmp_path / "root.tltl").write_text("signal ee[2]\nconst low = 0\nspec: F G (sqrt(ee.y - low) > 0.3)\n")
    small = (*SMALL, "spec=root.tltl", "cases=[tltl_episodic]", "seeds=1", "workers=1", "task.steps=4")
    code, _, errors = run(tmp_path, "-m", *small, "constants.low=9,-9")
    assert code == 1
    assert "tltl-run: 1 of 2 experiments failed: small,constants.low=9;" in errors
    assert (tmp_path / "runs/small,constants.low=-9/report.md").exists()


OF_TOAST = {"experiment=toast", "seeds=3", "--cfg job"}


@pytest.mark.parametrize("order", itertools.permutations(sorted(OF_TOAST)), ids=" ".join)
def test_options_stand_anywhere(order, capsys):
    assert cli.run(" ".join(order).split()) == 0
    settings = yaml.safe_load(capsys.readouterr().out)
    assert (settings["name"], settings["seeds"]) == ("toast", 3)


def test_a_manifest_is_repeated_with_other_values_wherever_they_stand(undisturbed, capsys):
    made = str(undisturbed / "manifest.json")
    assert cli.run(["name=again", "--cfg", "job", "--from", made, "++constants.goal_radius=0.4"]) == 0
    settings = yaml.safe_load(capsys.readouterr().out)
    assert (settings["name"], settings["constants"]) == ("again", {"goal_radius": 0.4})
    assert settings["algorithm"]["samples"] == 8


def test_the_version_is_tltlrls(capsys):
    assert cli.run(["--version"]) == 0
    with pytest.raises(SystemExit, match="0"):
        cli.main(["--version"])
    assert capsys.readouterr().out == f"tltlrl {tltlrl.__version__}\n" * 2


def test_the_commands_answer_ctrl_c_before_they_import_what_takes_time(tmp_path):
    """And Ctrl-C while that is imported is told like any other."""
    code = (
        "import sys, tltlrl.cli.main; print([m for m in ('numpy', 'lark', 'hydra', 'omegaconf') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "[]\n"
    (tmp_path / "hydra.py").write_text("raise KeyboardInterrupt\n")
    (tmp_path / "numpy.py").write_text("raise KeyboardInterrupt\n")
    for command in ("run(['experiment=toast'])", "main(['check', 'toast.tltl'])"):
        code = f"import sys; from tltlrl.cli.main import *; sys.path.insert(0, {str(tmp_path)!r}); sys.exit({command})"
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 130
        assert done.stderr.endswith(": stopped; the same command continues from what is done\n")
        assert "Traceback" not in done.stderr


def test_help_is_for_people_who_do_not_know_hydra(tmp_path):
    code, output, _ = run(tmp_path, "--help")
    assert code == 0
    for line in (
        "Examples",
        "Experiments: reach_avoid, reach_avoid_best, toast, toast_best",
        "samples: 20",
        "Exit codes:",
    ):
        assert line in output
    assert re.search(r"^    epsilon: 1.0 +# bound of the samples' KL per update, nats", output, re.MULTILINE)
    assert re.search(r"^    steps: 200 +# samples of one episode$", output, re.MULTILINE)
    assert max(len(line) for line in output.splitlines()) <= 100
    assert list(tmp_path.iterdir()) == []


def test_help_is_about_the_experiment_that_is_given(capsys):
    assert cli.run(["experiment=toast", "--help"]) == 0
    output = capsys.readouterr().out
    assert re.search(r"^    # step at which the rough motion opens.*\n    opening_step: 52$", output, re.MULTILINE)
    assert max(len(line) for line in output.splitlines()) <= 100


def test_an_experiment_of_ones_own_in_a_config_folder(tmp_path):
    (tmp_path / "mine" / "experiment").mkdir(parents=True)
    (tmp_path / "mine" / "experiment" / "short.yaml").write_text(
        "# @package _global_\ndefaults:\n  - reach_avoid\n  - _self_\nname: short\ncases: [tltl_episodic]\nseeds: [3]\n"
        "trials: 2\ntask: {steps: 30}\nalgorithm: {iterations: 2, samples: 4}\n"
    )
    code, _, errors = run(tmp_path, "--config-dir", str(tmp_path / "mine"), "experiment=short", "workers=1")
    assert code == 0, errors
    assert Path(tmp_path / "runs/short/tltl_episodic/seed_3/done.json").exists()


@pytest.mark.parametrize(
    ("content", "arguments", "message"),
    [
        (
            b"name: mine\ndefaults: [/task: reach_avoid, reach_avoid]\n",
            ["experiment=mine"],
            "the first line of the file that is chosen",
        ),
        (
            b"# @package _global_\nname: [mine\n",
            ["experiment=mine"],
            "mine.yaml, line 3: it is not YAML: expected ',' or ']'",
        ),
        (b"# @package _global_\nname: caf\xe9\n", ["experiment=mine"], "experiment=mine: one of these files"),
        (
            b"# @package _global_\ndefaults: [reach_avoid]\n",
            ["experiment=mine", "sedes=3"],
            "sedes: no such key; did you mean seeds?",
        ),
        (b"", [], "say which experiment: experiment=NAME, one of: mine, reach_avoid, reach_avoid_best, toast"),
    ],
)
def test_a_mistake_in_an_experiment_of_ones_own_is_told(tmp_path, capsys, content, arguments, message):
    (tmp_path / "a folder, mine" / "experiment").mkdir(parents=True)
    (tmp_path / "a folder, mine" / "experiment" / "mine.yaml").write_bytes(content)
    assert cli.run([*arguments, "--config-dir", str(tmp_path / "a folder, mine")]) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("tltl-run: ")
    assert message in errors
    assert len(errors.splitlines()) == 1
