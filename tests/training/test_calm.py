"""How much of the learned robustness a calm motion may spend."""

import numpy as np
import pytest

from tltlrl.training.calm import floor


def test_the_floor_sinks_to_the_share_and_stays_there():
    floors = [floor(0.5, 0.7, batch, 10) for batch in range(10)]
    assert np.all(np.diff(floors[:7]) < 0)
    assert floors[6:] == pytest.approx([0.35] * 4)
    assert floors[0] < 0.5
