"""The same examples on every run: a test that fails once fails again. And Ctrl-C, for tests of it."""

import gc
import signal
from pathlib import Path

import forked
import pytest
from hypothesis import settings
from sketched.sketch import sketch

from tltlrl.reports import plotting

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a job that a script began in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_collection_modifyitems(items):
    """The longest begin first, so that no worker waits for another one at the end."""
    items.sort(key=lambda item: item.path.name != "test_readme.py")


def pytest_collection_finish():
    """What is imported by now stays: the garbage collector need not go through it again, here and in what is forked."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def package(monkeypatch):
    """The folder of a package with a task and a learner of its own, on the path as if it were installed."""
    folder = Path(__file__).parent / "package"
    monkeypatch.syspath_prepend(folder)
    return folder


@pytest.fixture
def without_pictures(monkeypatch):
    """Commands of this process draw none: they take most of the time of a small experiment."""
    for place in forked.PICTURES:
        monkeypatch.setattr(place, lambda *_, **__: None)


@pytest.fixture
def with_sketches(monkeypatch):
    """Pictures of this process are there, but not painted."""
    monkeypatch.setattr(plotting, "picture", sketch)
