"""Which studies may extend the folder of another."""

import pytest

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.experiment import changes


def study(*overrides):
    return read(compose(["task=short_arm", "spec=reach_avoid.tltl", *overrides]))[0]


@pytest.mark.usefixtures("package")
def test_a_case_of_another_learner_extends_a_folder_with_its_own_settings():
    before = study("cases=[tltl_episodic]")
    both = study("cases=[tltl_episodic,tltl_careful]", "seeds=9")
    assert changes(before.settings, both) == ""
    changed = study("cases=[tltl_episodic,tltl_careful]", "seeds=9", "algorithm.caution=0.1")
    assert changes(before.settings, changed) == ""
    assert changes(both.settings, changed) == "  algorithm.caution: 0.5 there, 0.1 now"
    assert "  cases: " in changes(both.settings, before)


@pytest.mark.usefixtures("package")
def test_a_setting_that_a_learner_must_have_had_is_missed():
    before = study("cases=[tltl_careful]")
    damaged = dict(before.settings) | {
        "algorithm": {k: v for k, v in before.settings["algorithm"].items() if k != "caution"}
    }
    assert changes(damaged, before) == "  algorithm.caution: absent there, 0.5 now"
    for nonsense in (None, 3.5, {}):
        assert "  cases: " in changes(dict(before.settings) | {"cases": nonsense}, before)
