"""Every mistake in a robot's page or its model is told: where, what, what to do. The texts are in mistakes.txt."""

import re
from pathlib import Path

import pytest
from robots import MODELS

from tltlrl.errors import UserError
from tltlrl.tasks.mjcf.evaluation import evaluation_of
from tltlrl.tasks.mjcf.file import config_of
from tltlrl.tasks.mjcf.robot import Robot

CASES = [case.split(">>\n") for case in (Path(__file__).parent / "mistakes.txt").read_text().split("==\n")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("robots")
    for name, text in MODELS.items():
        (folder / name).write_text(text)
    return folder


def told(folder, page):
    (folder / "arm.yaml").write_text(page)
    with pytest.raises(UserError) as error:
        make(folder / "arm.yaml")
    return str(error.value)


def make(page):
    config = config_of(page)
    Robot(config)
    Robot(evaluation_of(config))


def test_there_are_many():
    assert len(CASES) >= 40
    assert len({page for page, _ in CASES}) == len(CASES)


@pytest.mark.parametrize(("page", "message"), CASES)
def test_a_mistake_is_told(folder, monkeypatch, page, message):
    monkeypatch.chdir(folder)
    assert told(folder, page) + "\n" == message


@pytest.mark.parametrize(("page", "message"), CASES)
def test_every_message_points(page, message):
    """A file first; its line, but where MuJoCo says none."""
    assert re.match(r"\w+\.(yaml|xml)(:\d+)?: ", message), page
    assert message.count("\n") <= 2


def test_a_file_that_is_no_text_is_told(folder, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "binary.yaml").write_bytes(b"model: \xff")
    with pytest.raises(UserError, match=r"^binary\.yaml: it is not text in UTF-8; save it as UTF-8$"):
        config_of(folder / "binary.yaml")
