"""Every command and every line of code of the README, as written."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import forked
import numpy as np
import pytest

from tltlrl.cli.check import check
from tltlrl.config.compose import as_meant, compose, searchpath
from tltlrl.config.read import read
from tltlrl.experiments.search import parse_space
from tltlrl.resources import SPECS

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page, flags=re.MULTILINE | re.DOTALL)


PART = "task.steps=104 algorithm.iterations=40 algorithm.calm=2 trials=20"  # 5 s are 100 steps
SHELL = blocks(README, "sh")
DOCS = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")}


def shell(script, folder, **environment):
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        cwd=folder,
        env={name: value for name, value in os.environ.items() if name != "MUJOCO_GL"} | environment,  # a user's own
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture
def folder(tmp_path):
    """An empty folder that has this environment as its .venv."""
    (tmp_path / ".venv").symlink_to(sys.prefix)
    return tmp_path


def test_the_two_commands_are_the_makefiles():
    assert SHELL[0].split("\n") == ["make reproduce-figures", "make test", ""]
    for command in ("reproduce-figures", "test", "bench"):
        shell(f"make --dry-run {command}", ROOT)


def test_ci_runs_the_test_command_and_nothing_else():
    lines = [line for line in (ROOT / ".ci/run").read_text().splitlines() if line and not line.startswith("#")]
    assert lines == ["set -euo pipefail", 'cd "$(dirname "$0")/.."', "make test"]


def test_reproduce_figures_in_small(tmp_path):
    """The make target itself, every experiment of it, at a small budget and with one case."""
    if not (ROOT / ".venv" / ".ready").exists():
        pytest.skip("needs the environment that make test sets up")
    small = "seeds=1 trials=1 workers=1 cases=tltl_episodic task.steps=90 algorithm.iterations=2 algorithm.samples=6"
    path = forked.sketched()["PYTHONPATH"]
    shell(f"make reproduce-figures RUNS={tmp_path} OVERRIDES='{small}'", ROOT, PYTHONPATH=path)
    for name in (
        "figure_3_3.png",
        "figure_3_4.pdf",
        "reach_avoid/report.md",
        "visit_in_order/report.md",
        "smoothness.csv",
        "toast/claims.md",
    ):
        assert (tmp_path / name).stat().st_size > 0


def test_write_your_own_spec(folder):
    """Ten lines that work when typed, and learn; here in a part of the time."""
    script = SHELL[1]
    path = forked.sketched()["PYTHONPATH"]  # the films are real and small, the plots sketches
    printed = shell(script.replace(" seeds=1\n", f" seeds=1 {PART}\n"), folder, PYTHONPATH=path)
    assert "satisfied 1 of 1" in printed
    assert "success rate" in printed
    for name in ("workspace.png", "motion.gif", "motion_calm.gif"):
        assert (folder / "runs/my_task/tltl_episodic/seed_0" / name).stat().st_size > 0
    assert len(script.split("END\n")[0].splitlines()) <= 10

    assert len(SHELL) == 2  # and no block that is not tested


def test_getting_started_has_the_readmes_spec_and_commands():
    """So they run; and the set-up is the Makefile's."""
    setup, *commands = blocks(DOCS["getting-started"], "sh")
    assert "".join(blocks(DOCS["getting-started"], "tltl")) in SHELL[1]
    assert "".join(commands) == SHELL[1].split("END\n")[1]
    assert setup.splitlines() == ["make .venv/.ready", SHELL[1].splitlines()[0]]
    shell("make --dry-run .venv/.ready", ROOT)


def test_comparing_rewards(tmp_path):
    (script,) = blocks(DOCS["comparing"], "sh")
    small = " task.steps=60 workers=1 cases=tltl_episodic,discrete_step seeds=7,"
    for line in script.replace(" seeds=7,", small).splitlines():
        name, *words = shlex.split(line)
        command = {"tltl-run": forked.tltl_run, "tltl": forked.tltl}[name]
        code, _, errors = command(tmp_path, *words, first=forked.with_sketches)
        assert code == 0, errors
    assert (tmp_path / "runs/small/learning_curves.png").stat().st_size > 0


def test_python_code_says_what_it_gives():
    (code,) = blocks(DOCS["api"], "python")
    names = {}
    exec(code, names)
    np.testing.assert_allclose(names["spec"].robustness({"x": names["x"]}), [0.1, -0.1])
    assert "array([ 0.1, -0.1])" in code
    assert names["env"].reset().first()


def test_the_page_of_a_package_index_needs_no_checkout():
    """Relative links and pictures would be dead there; its code says what it gives, and its commands are real."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    page = (ROOT / project["readme"]).read_text(encoding="utf-8")
    assert not re.findall(r"\]\((?!https://)", page)
    assert "\npip install tltlrl " in page
    assert project["license"] in page
    assert blocks(page, "python")[0] in DOCS["api"]  # where it is tested
    assert check(SPECS / blocks(page, "sh")[0].split("tltl check ")[1].split()[0]) == 0
    for command in re.findall(r"^tltl-run (.*)$", page, flags=re.MULTILINE):
        read(compose([as_meant(override) for override in command.split()]))


def test_an_experiment_of_ones_own_as_documented(tmp_path):
    page = DOCS["configs"]
    top, place = re.findall(r"^ *(\S+/\S*)", blocks(page, "")[0], flags=re.MULTILINE)[:2]
    (tmp_path / top / place).parent.mkdir(parents=True)
    (tmp_path / top / place).write_text(blocks(page, "yaml")[0])
    run, search = re.findall(r"^    tltl(?:-run| search) --config-dir (.*)$", page, flags=re.MULTILINE)
    folder, chosen = run.split()
    study, _ = read(compose([*searchpath(tmp_path / folder), chosen]))
    folder, *chosen = shlex.split(search)
    fixed, space, _ = parse_space(chosen)
    assert compose([*searchpath(tmp_path / folder), *fixed])["name"] == "short"
    assert [*space] == ["algorithm.epsilon"]
    assert (study.name, study.seeds, study.task.steps, study.algorithm.samples) == ("short", (3,), 30, 4)
