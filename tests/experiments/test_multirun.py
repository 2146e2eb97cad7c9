"""How tltl-run -m takes overrides apart, and what the folders of its combinations are called."""

import pytest

from tltlrl.errors import UserError
from tltlrl.experiments.multirun import combinations, folder_name


def test_every_combination_has_all_overrides_and_its_own_values():
    machinery, found = combinations(["experiment=toast", "hydra/launcher=basic", "constants.r=1,2", "seeds=choice(3)"])
    assert machinery == ["hydra/launcher=basic"]
    assert found == [
        (["experiment=toast", f"++constants.r={r}", "seeds=3"], [f"++constants.r={r}", "seeds=3"]) for r in (1, 2)
    ]


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["trials=1,2", "trials=3"], [["trials=3"]]),
        (["trials=3", "trials=1,2"], [["trials=1"], ["trials=2"]]),
        (["trials=range(1,3)"], [["trials=1"], ["trials=2"]]),
        (["seeds=[1,2]"], [["seeds=[1,2]"]]),
    ],
)
def test_the_last_value_of_a_key_counts_and_a_list_is_one_value(overrides, expected):
    assert [combination for combination, _ in combinations(overrides)[1]] == expected


def test_what_cannot_be_enumerated_is_told():
    with pytest.raises(UserError, match=r"trials=interval\(1,2\): -m needs single values"):
        combinations(["trials=interval(1,2)"])
    with pytest.raises(UserError, match=r"^constants.r=\[0:2: not readable as key=value"):
        combinations(["constants.r=[0:2"])


@pytest.mark.parametrize(
    ("swept", "expected"),
    [
        ([], "mine"),
        (["algorithm.epsilon=0.2", "++constants.r=1"], "mine,algorithm.epsilon=0.2,constants.r=1"),
        (["spec=my/task.tltl"], "mine,spec=my-task.tltl"),
        (["experiment=toast", "name=mine", "seeds=3", "engine.address=tcp://a:1", "engine=local", "workers=2"], "mine"),
    ],
)
def test_the_folders_name_has_what_tells_a_combination_from_the_others(swept, expected):
    assert folder_name("mine", swept) == expected


def test_a_long_name_is_cut_and_stays_different():
    first, second = (folder_name("ü", [f"task.waypoints={[[0.25] * 100, last]}"]) for last in (1, 2))
    assert first != second
    assert first[:100] == second[:100]
    assert len(first.encode()) <= len(second.encode()) <= 200
