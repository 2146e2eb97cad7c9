"""The worked example, installed into a folder of its own: its task and its learner go through the real command."""

import csv
import functools
import os
import re
import subprocess
import sys
from pathlib import Path

import forked
import pytest

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples/two_link"
WITHOUT_PICTURES = f"import sys; sys.path.append({str(ROOT / 'tests')!r}); import forked; forked.without_pictures()"


@pytest.fixture(scope="module")
def python(tmp_path_factory):
    """Runs Python with the example installed, in a folder where neither source lies."""
    site, elsewhere = tmp_path_factory.mktemp("site"), tmp_path_factory.mktemp("elsewhere")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", site, EXAMPLE]
    subprocess.run(pip, check=True, capture_output=True, timeout=300)

    def run(*arguments):
        return subprocess.run(
            [sys.executable, *arguments],
            cwd=elsewhere,
            env=os.environ | {"PYTHONPATH": f"{site}{os.pathsep}{ROOT}"},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    run.folder, run.site = elsewhere, site
    return run


def tltl_run(python, *overrides):
    """The exit code and the messages of `tltl-run task=two_link`, in a process that has the example on its path."""
    installed = functools.partial(sys.path.insert, 0, str(python.site))
    code, _, errors = forked.tltl_run(
        python.folder, "task=two_link", *overrides, first=lambda: (installed(), forked.with_sketches())
    )
    return code, errors


def test_it_is_listed_beside_what_is_built_in(python):
    code = "from tltlrl.registry import LEARNERS, TASKS; print(TASKS.names()[-1], LEARNERS.names()[-1])"
    assert python("-c", code).stdout == "two_link cem\n"


def test_its_task_keeps_the_contract(python):
    (command,) = re.findall(
        r'^    python -c "(import tltlrl; .*check_task.*)"$', (EXAMPLE / "README.md").read_text(), re.M
    )
    done = python("-W", "error", "-c", command)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_its_learner_keeps_the_contract(python):
    """By the tests of every learner, which go through the registry."""
    done = python("-m", "pytest", "-q", "-p", "no:cacheprovider", ROOT / "tests/learning/test_learners.py", "-k", "cem")
    assert done.returncode == 0, done.stdout
    assert re.search(r"\d+ passed", done.stdout) or set(done.stdout.split()[0]) == {"."}


def test_its_task_and_its_learner_run_by_the_command_and_by_workers(python):
    """Two workers write the bytes that one does."""
    cases = "cases=[tltl_cem,distance_cem,tltl_episodic]"
    budget = ("seeds=1", "trials=5", "algorithm.iterations=4", "algorithm.elite=0.3", "task.steps=25")
    code, errors = tltl_run(python, cases, *budget, "workers=1", "name=by_1")
    assert code == 0, errors
    command = "import sys; from tltlrl.cli.main import run; sys.exit(run(sys.argv[1:]))"
    done = python("-c", f"{WITHOUT_PICTURES}; {command}", "task=two_link", cases, *budget, "workers=2", "name=by_2")
    assert done.returncode == 0, done.stderr
    one, two = (
        {path.relative_to(folder): path.read_bytes() for path in folder.glob("*/seed_0/progress.csv")}
        for folder in (python.folder / "runs/by_1", python.folder / "runs/by_2")
    )
    assert one == two
    assert {path.parts[0] for path in one} == {"tltl_cem", "distance_cem", "tltl_episodic"}
    with open(python.folder / "runs/by_1/tltl_cem/seed_0/progress.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 4
    assert list(rows[0])[-2:] == ["elite_return", "spread"]  # the learner's own columns
    assert (python.folder / "runs/by_1/tltl_cem/workspace.png").exists()  # the task has a skeleton


def test_what_is_wrong_is_told_as_for_a_built_in_task(python):
    for override, message in (
        ("task.steps=1", "task.steps: 1 is too small; it must be at least 2"),
        ("algorithm.elite=0.01", "algorithm.elite: 0.01 of 20 samples are fewer than two; raise it, or draw more"),
    ):
        code, errors = tltl_run(python, "cases=[tltl_cem]", "seeds=1", override)
        assert code == 2
        assert message in errors
        assert "Traceback" not in errors
    code, errors = tltl_run(python, "cases=[nearness_cem]", "seeds=1")
    assert code == 2
    assert "distance_cem" in errors
