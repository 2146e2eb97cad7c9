"""Files of others that are deep, large or unfold to more than memory holds: refused, each with one message."""

import pytest

from tltlrl.config.compose import searchpath
from tltlrl.errors import UserError
from tltlrl.experiments.folder import read_record
from tltlrl.experiments.manifest import read_manifest
from tltlrl.store import bounded
from tltlrl.store.run import DamagedError, iterations_done, read_results
from tltlrl.tasks.mjcf.page import read_page

BOMB = "a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)
DEEP = "[" * 100_000 + "]" * 100_000
ITSELF = "a: &a [*a]\n"


def test_json_that_is_too_deep_or_too_large_is_none_of_ours(tmp_path, monkeypatch):
    (tmp_path / "manifest.json").write_text(DEEP)
    (tmp_path / "done.json").write_text(DEEP)
    assert read_manifest(tmp_path / "manifest.json") is None
    assert iterations_done(tmp_path) is None
    with pytest.raises(DamagedError, match=r"done\.json cannot be read \(done\.json is nested too deeply\)"):
        read_results(tmp_path)
    monkeypatch.setattr(bounded, "MOST_BYTES", 100)
    with pytest.raises(DamagedError, match=r"done\.json is larger than"):
        read_results(tmp_path)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (BOMB, "it holds more than 200000 values, its aliases unfolded"),
        ("[" * 500 + "]" * 500, "it is nested"),
        (f"a: {'[' * 70}{']' * 70}\n", "it is nested more than 64 levels deep"),
        (ITSELF, "an alias stands within what it names"),
    ],
    ids=["bomb", "deep", "rather deep", "itself"],
)
def test_yaml_is_not_unfolded_without_bounds(tmp_path, content, told):
    page = tmp_path / "experiment/arm.yaml"
    page.parent.mkdir()
    page.write_text(content)
    assert read_record(page, {"a"}) is None
    for read in (lambda: read_page(page), lambda: searchpath(tmp_path)):
        with pytest.raises(UserError) as refused:
            read()
        assert str(page) in str(refused.value)
        assert told in str(refused.value)


def test_yaml_within_the_bounds_is_read_with_its_aliases(tmp_path):
    (tmp_path / "a.yaml").write_text("a: &a [1, 2.5, x]\nb: {c: *a}\n")
    assert bounded.read_yaml(tmp_path / "a.yaml") == {"a": [1, 2.5, "x"], "b": {"c": [1, 2.5, "x"]}}
