"""Which renderer is taken: the user's own, else the first that loads."""

import os
import subprocess
import sys

import pytest

from tltlrl.tasks import headless


@pytest.mark.parametrize(
    ("asked", "display", "loading", "tried", "taken"),
    [
        (None, None, {"egl"}, ["egl"], "egl"),
        (None, None, {"osmesa"}, ["egl", "osmesa"], "osmesa"),
        (None, None, set(), ["egl", "osmesa"], "disable"),
        (None, ":0", {"glfw", "egl"}, ["glfw"], "glfw"),
        (None, ":77", {"egl"}, ["glfw", "egl"], "egl"),
        ("", None, {"egl"}, ["egl"], "egl"),
        ("osmesa", ":0", {"osmesa", "egl"}, ["osmesa"], "osmesa"),
    ],
)
def test_the_first_that_loads_is_taken(monkeypatch, asked, display, loading, tried, taken):
    assert chosen(monkeypatch, asked, display, loading) == (taken, tried)


def test_a_choice_that_does_not_load_is_told(monkeypatch):
    with pytest.warns(UserWarning, match="MUJOCO_GL=nonsense cannot be used on this machine; egl is taken"):
        assert chosen(monkeypatch, "nonsense", None, {"egl"}) == ("egl", ["nonsense", "egl"])


def chosen(monkeypatch, asked, display, loading):
    tried = []

    def loads(backend):
        os.environ["MUJOCO_GL"] = backend
        if backend != "disable":
            tried.append(backend)
        return backend in {*loading, "disable"}

    monkeypatch.setattr(headless, "_loads", loads)
    monkeypatch.setattr(headless.sys, "platform", "linux")
    for name, value in (("MUJOCO_GL", asked), ("DISPLAY", display)):
        monkeypatch.delenv(name, raising=False)
        if value is not None:
            monkeypatch.setenv(name, value)
    headless.choose_renderer()
    return os.environ["MUJOCO_GL"], tried


def test_what_renders_nothing_needs_no_renderer(tmp_path):
    code = "from tltlrl.cli.main import *; run(['experiment=toast', 'cases=nix']); main(['evaluate', 'nix'])"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"MUJOCO_GL": "nonsense"},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    told, nothing = done.stderr.splitlines()
    assert told.startswith("tltl-run: cases: no case is named nix")
    assert nothing.startswith("tltl: nix is not the folder of a finished run")
