"""Installed from a wheel and used from another folder, configs and specs are found."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder that holds what the wheel holds."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, ROOT],
        check=True,
        capture_output=True,
        timeout=300,
    )
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def python(code, site, folder, *more):
    return subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(site)!r}); {code}"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (site, *more)))},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def test_every_config_and_spec_is_in_the_wheel(installed):
    for source in ("configs", "specs"):
        inside = {
            path.relative_to(installed / "tltlrl" / source) for path in (installed / "tltlrl" / source).rglob("*.*")
        }
        assert inside == {path.relative_to(ROOT / source) for path in (ROOT / source).rglob("*.*")}
    assert (installed / "tltlrl/tasks/planar_arm/arm.xml").exists()
    assert (installed / "tltlrl/logic/grammar.lark").exists()


def test_an_experiment_runs_from_another_folder(installed, tmp_path):
    code = (
        "import tltlrl; assert tltlrl.__file__.startswith(sys.path[0]), tltlrl.__file__; "
        "from tltlrl.cli.main import run; "
        "sys.exit(run(['experiment=reach_avoid', 'seeds=1', 'cases=[tltl_episodic]', 'workers=1', 'trials=2', "
        "'algorithm.iterations=1', 'task.steps=10']))"
    )
    done = python(code, installed, tmp_path, Path(__file__).with_name("sketched"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs/reach_avoid/summary.csv").exists()


def test_a_spec_alone_loads_neither_mujoco_nor_hydra(installed, tmp_path):
    done = python(
        "import tltlrl.logic, tltlrl.learning.reps; tltlrl.logic.parse_spec('F x > 0'); "
        "print({'mujoco', 'dm_control', 'hydra', 'matplotlib', 'pandas'} & sys.modules.keys())",
        installed,
        tmp_path,
    )
    assert done.stdout.strip() == "set()", done.stderr
