"""That an attack which succeeds is noticed; the attacks themselves are `make attack`."""

import random

import pytest

from studies import attack


def test_a_command_that_ends_as_none_may_is_noticed(tmp_path):
    assert attack.wrong(*attack.command(tmp_path, "check", "none.tltl")) == ""

    def broken():
        raise KeyError("of our own")

    assert (
        attack.wrong(*attack.command(tmp_path, "check", "none.tltl", first=broken))
        == "a traceback: KeyError: 'of our own'"
    )
    code, said = attack.command(tmp_path, "check", "none.tltl", first=lambda: attack._die_in(0) or attack.time.sleep(9))
    assert attack.wrong(code, said) == "exit code -9"


@pytest.mark.parametrize("seed", range(9))
def test_every_damage_changes_the_file(tmp_path, seed):
    path = tmp_path / "a.csv"
    path.write_bytes(b"x,y\n-1,2\n")
    kind = attack.damage(path, random.Random(seed))
    assert kind
    assert not path.exists() or path.read_bytes() != b"x,y\n-1,2\n"
