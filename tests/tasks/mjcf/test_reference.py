"""The table of keys drives the dataclass, the reader and the reference page."""

import dataclasses
from pathlib import Path

import yaml

from tltlrl.settings import settings_of
from tltlrl.tasks.mjcf.keys import KINDS, RobotConfig
from tltlrl.tasks.mjcf.page import page_of
from tltlrl.tasks.mjcf.reference import reference

ROOT = Path(__file__).parents[3]


def test_the_reference_page_is_what_the_table_says():
    assert (ROOT / "docs/robot-yaml.md").read_text() == reference()


def test_every_key_has_a_meaning_and_a_kind():
    names = [field.name for field in dataclasses.fields(RobotConfig)]
    assert list(settings_of(RobotConfig)) == names
    assert ["name", "file", "digest", *KINDS] == names


def test_every_example_is_a_page():
    for key, kind in KINDS.items():
        text = f"{key}: {kind.example}" if key == "model" else f"model: arm.xml\n{key}: {kind.example}"
        assert page_of(Path("arm.yaml"), text.encode()).values[key] == yaml.safe_load(kind.example)
