"""How much of the learned robustness a calm motion may spend."""

from types import SimpleNamespace

import numpy as np
import pytest

from tltlrl.logic import parse_spec
from tltlrl.training.calm import events, floor, straightness


def test_the_floor_sinks_to_the_share_and_stays_there():
    floors = [floor(0.5, 0.7, batch, 10) for batch in range(10)]
    assert np.all(np.diff(floors[:7]) < 0)
    assert floors[6:] == pytest.approx([0.35] * 4)
    assert floors[0] < 0.5


def test_the_path_is_made_short_before_it_is_made_even():
    weights = [straightness(batch, 10) for batch in range(10)]
    assert np.all(np.diff(weights[:8]) < 0)
    np.testing.assert_allclose(np.diff(np.log(weights[:7])), np.log(weights[1] / weights[0]))
    assert weights[0] == 1
    assert weights[7:] == pytest.approx([0.06] * 3)


def test_events_are_where_a_predicate_becomes_true_or_false():
    spec = parse_spec("signal x\nspec: F x > 1 & G x > -9 & F x < 0")
    task = SimpleNamespace(signals=lambda features, _: {"x": features[..., 0]})
    x = np.array([0.5, 2, 2, 0.5, 0.5, -1, 5, 5])
    motion = SimpleNamespace(
        features=x[None, :, None], commands=None, lengths=np.array([6])
    )  # the rest is after its end
    assert events(spec, task, motion).tolist() == [1, 3, 5]
