from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent / "package"


@pytest.fixture
def package(monkeypatch):
    """The folder of a package with a task and a learner of its own, as if it were installed."""
    monkeypatch.syspath_prepend(PACKAGE)
    return PACKAGE
