"""The lowest versions, as constraints."""

import re
from importlib.metadata import version

from packaging.version import Version

from studies.lowest import PYPROJECT, lowest


def test_each_lower_bound_is_a_pin_and_the_rest_is_left_to_pip():
    text = """
[project]
dependencies = ["a-b>=1.2,<2", "c==3.0"]
optional-dependencies.more = ["d>=4.5.6", "me[more]", "e"]
"""
    assert lowest(text) == ["a-b==1.2", "c==3.0", "d==4.5.6"]


def test_nothing_here_is_below_what_pyproject_allows():
    bounds = dict(line.split("==") for line in lowest(PYPROJECT.read_text()))
    assert {"numpy", "mujoco", "pandas", "distributed"} <= bounds.keys()
    for name in ("numpy", "mujoco", "pandas", "distributed"):
        assert Version(re.match(r"[0-9.]+", version(name))[0]) >= Version(bounds[name])
