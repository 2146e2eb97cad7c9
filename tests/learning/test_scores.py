"""The leximin surrogate of a trajectory's clauses."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from tltlrl.learning.scores import leximin

CLAUSES = arrays(float, array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.floats(-10, 10))


@given(CLAUSES)
def test_it_weighs_the_worst_clause_by_one_and_each_better_one_by_half_of_that(clauses):
    for values, told in zip(clauses, leximin(clauses), strict=True):
        assert np.isclose(told, sum(value / 2**k for k, value in enumerate(sorted(values))), atol=1e-12)


@given(CLAUSES, st.randoms())
def test_the_order_of_the_clauses_does_not_matter(clauses, random):
    order = list(range(clauses.shape[1]))
    random.shuffle(order)
    np.testing.assert_array_equal(leximin(clauses), leximin(clauses[:, order]))


@given(CLAUSES, st.data())
def test_a_clause_that_gets_better_is_never_worse_to_have(clauses, data):
    better = clauses.copy()
    better[:, data.draw(st.integers(0, clauses.shape[1] - 1))] += data.draw(st.floats(0, 5))
    assert np.all(leximin(better) >= leximin(clauses) - 1e-12)


def test_it_tells_two_trajectories_apart_that_fail_at_the_same_clause():
    one, other = leximin(np.array([[-1.0, -0.5, 0.2], [-1.0, 0.1, 0.2]]))
    assert other > one


@pytest.mark.parametrize(
    ("clauses", "told"),
    [
        ([-1.0, 0.5, np.inf], -1 + 0.25 + 0.125),
        ([np.inf, -2.0, np.inf], -2 * 1.75),
        ([-np.inf, 1.0, np.inf], -np.inf),
        ([-np.inf, np.inf, np.inf], -np.inf),
        ([np.inf, np.inf, np.inf], np.inf),
    ],
)
def test_a_clause_that_nothing_decides_counts_as_much_as_the_best_that_something_does(clauses, told):
    assert leximin(np.array([clauses]))[0] == told
