import shutil

import numpy as np
import pytest

from studies.same_bytes import main

RUN = "reach_avoid/tltl_episodic/seed_0"
ARRAYS = {"gain": np.eye(2), "mean": np.zeros((3, 2)), "correlation": np.array(1.0)}


def make(folder, run, **arrays):
    path = folder / run
    path.mkdir(parents=True)
    (path / "progress.csv").write_bytes(b"iteration,eta\n0,1.0\n1,2.0\n")
    np.savez(path / "policy.npz", **(ARRAYS | arrays))


@pytest.fixture
def folders(tmp_path):
    """Two folders with the same two runs."""
    old, new = tmp_path / "old", tmp_path / "new"
    for run in (RUN, "toast/continuous_episodic/seed_1"):
        make(old, run)
    shutil.copytree(old, new)
    return old, new


def compare(folders):
    return main([str(folder) for folder in folders])


def test_the_same(folders, capsys):
    make(folders[1], "reach_avoid/tltl_episodic/seed_5")  # more runs in NEW do not matter
    assert compare(folders) == 0
    assert capsys.readouterr().out == f"{RUN}: same\ntoast/continuous_episodic/seed_1: same\n"


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        (b"iteration,eta\n0,1.0\n1,2.5\n", 3),
        (b"iteration,eta\n0,1.0\n", 3),
        (b"iteration,eta\n0,1.0\n1,2.0", 3),
        (b"iteration,eta\n0,1.0\n1,2.0\n2,3.0\n", 4),
    ],
)
def test_another_progress(folders, capsys, rows, line):
    (folders[1] / RUN / "progress.csv").write_bytes(rows)
    assert compare(folders) == 1
    assert f"{RUN}: progress.csv differs first in line {line}\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"mean": np.full((3, 2), -0.0)}, "mean in policy.npz differs"),  # equal numbers, other bytes
        ({"gain": np.eye(2, dtype=np.float32)}, "gain in policy.npz is float32 (2, 2) and was float64 (2, 2)"),
        ({"mean": np.zeros((2, 3))}, "mean in policy.npz is float64 (2, 3) and was float64 (3, 2)"),
        (
            {"more": np.zeros(1)},
            "policy.npz has the arrays correlation, gain, mean, more and had correlation, gain, mean",
        ),
    ],
)
def test_another_policy(folders, capsys, arrays, message):
    shutil.rmtree(folders[1] / RUN)
    make(folders[1], RUN, **arrays)
    assert compare(folders) == 1
    assert f"{RUN}: {message}\n" in capsys.readouterr().out


def test_nan_is_the_same_as_itself(folders):
    for folder in folders:
        make(folder, "toast/tltl_episodic/seed_0", mean=np.full((3, 2), np.nan))
    assert compare(folders) == 0


def test_what_is_missing_is_told_in_one_message(folders, capsys, tmp_path):
    old, new = folders
    assert compare((old, tmp_path / "none")) == 2
    assert capsys.readouterr().err == f"there is no folder {tmp_path / 'none'}\n"
    shutil.rmtree(new / RUN)
    assert compare((old, new)) == 2
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", f"{new / RUN / 'progress.csv'} is missing\n")
    (tmp_path / "empty").mkdir()
    assert compare((tmp_path / "empty", new)) == 2
    assert "holds no run" in capsys.readouterr().err
