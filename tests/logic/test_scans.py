"""Scans of arrays that are large enough for passes over all samples at once, against NumPy's one by one."""

import numpy as np
import pytest

from tltlrl.logic import load_spec, scans
from tltlrl.resources import SPECS

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("shape", [(30, 499), (32, 512), (9, 513), (1, 5000), (5000, 1), (2500, 2), (2, 3000)])
@pytest.mark.parametrize("fold", [np.minimum, np.maximum])
@pytest.mark.parametrize("cut", [False, True])
def test_a_scan_by_doubling_is_the_scan(shape, fold, cut):
    x = RNG.choice([-np.inf, np.inf, *RNG.standard_normal(20)], size=(shape[0], shape[1] + 2))
    x = x[:, 1:-1] if cut else np.ascontiguousarray(x[:, 1:-1])
    before, out, spare = x.copy(), np.empty(shape), np.empty(shape)
    assert x.size in scans._DOUBLED
    np.testing.assert_array_equal(scans.suffixes(fold, x, out, spare), fold.accumulate(x[:, ::-1], axis=1)[:, ::-1])
    assert scans.suffixes(fold, x, out, spare) is out
    np.testing.assert_array_equal(scans.prefixes(fold, x, out, spare), fold.accumulate(x, axis=1))
    np.testing.assert_array_equal(x, before)


@pytest.mark.parametrize("steps", [200, 500])
def test_a_batch_has_the_values_of_its_trajectories_alone(steps):
    """One by one they are too small for doubling; a hundred are cut into blocks."""
    ee = np.cumsum(0.05 * RNG.standard_normal((100, steps, 2)), axis=1)
    spec = load_spec(SPECS / "visit_in_order.tltl")
    alone = [spec.robustness({"ee": ee[i : i + 1]})[0] for i in range(len(ee))]
    np.testing.assert_array_equal(spec.robustness({"ee": ee}), alone)
    over_time = np.concatenate([spec.robustness_over_time({"ee": ee[i : i + 1]}) for i in range(len(ee))])
    np.testing.assert_array_equal(spec.robustness_over_time({"ee": ee}), over_time)
