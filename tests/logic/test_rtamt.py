"""Agreement with rtamt, an independent evaluator, on formulas without T; its words are read as they are.

It reads X and previous weakly (+inf beyond the end) and leaves the witness out of U's left side, as TLTL does. Its U is
the unbounded or bounded one of signal temporal logic, whose left operand is not truncated: only state formulas there.
"""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tltlrl.logic import parse_spec

rtamt = pytest.importorskip("rtamt")

states = st.one_of(
    st.builds("({} < {})".format, st.sampled_from("xyz"), st.integers(-3, 3)),
    st.builds("({} > {})".format, st.sampled_from("xyz"), st.integers(-3, 3)),
)


def compound(inner):
    bounds = st.tuples(st.integers(0, 3), st.integers(0, 4)).map(lambda ab: f"[{ab[0]},{sum(ab)}]")
    return st.one_of(
        st.builds("(not {})".format, inner),
        st.builds("({} and {})".format, inner, inner),
        st.builds("({} or {})".format, inner, inner),
        st.builds("({} -> {})".format, inner, inner),
        st.builds("(always {})".format, inner),
        st.builds("(eventually {})".format, inner),
        st.builds("(next {})".format, inner),
        st.builds("({} until {})".format, states, inner),
        st.builds("(always{} {})".format, bounds, inner),
        st.builds("(eventually{} {})".format, bounds, inner),
        st.builds("(prev {})".format, inner),
        st.builds("(once {})".format, inner),
        st.builds("(historically {})".format, inner),
        st.builds("({} since {})".format, inner, inner),
        st.builds("(once{} {})".format, bounds, inner),
        st.builds("(historically{} {})".format, bounds, inner),
        st.builds("({} since{} {})".format, inner, bounds, inner),
        st.builds("(rise({}))".format, inner),
        st.builds("(fall({}))".format, inner),
    )


texts = st.recursive(states, compound, max_leaves=5)


def ours(text):
    return parse_spec("signal x\nsignal y\nsignal z\nspec: " + text)


@settings(deadline=None, max_examples=150)
@given(texts, st.integers(8, 16), st.integers(0, 1000))
def test_agreement(text, steps, seed):
    generator = np.random.default_rng(seed)
    signals = {name: generator.integers(-12, 13, steps) / 4 for name in "xyz"}
    spec = rtamt.STLDiscreteTimeSpecification()
    for name in "xyz":
        spec.declare_var(name, "float")
    spec.spec = text
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec.parse()
        values = spec.evaluate({"time": list(range(steps)), **{k: v.tolist() for k, v in signals.items()}})
    found = ours(text).robustness_over_time({name: v[None] for name, v in signals.items()})
    assert found[0].tolist() == [value for _, value in values]


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("prev a > 0", [np.inf, 100, -1, -2, 5]),
        ("next a > 0", [-1, -2, 5, -1, np.inf]),
        ("not (a > 0)", [-100, 1, 2, -5, 1]),
        ("a > 0 and b > 0", [20, -2, -2, 4, -1]),
        ("a > 0 or b > 0", [100, -1, 10, 5, -1]),
        ("a > 0 -> b > 0", [20, 1, 10, 4, 1]),
        ("always a > 0", [-2, -2, -2, -1, -1]),
        ("always[0,1] a > 0", [-1, -2, -2, -1, -1]),
        ("eventually a > 0", [100, 5, 5, 5, -1]),
        ("eventually[0,1] a > 0", [100, -1, 5, 5, -1]),
        ("a > 0 until b > 0", [20, -1, 10, 4, -1]),
        ("a > 0 until[0,1] b > 0", [20, -1, 10, 4, -1]),
        ("historically a > 0", [100, -1, -2, -2, -2]),
        ("historically[0,1] a > 0", [100, -1, -2, -2, -1]),
        ("historically[1,2] a > 0", [np.inf, 100, -1, -2, -2]),
        ("once a > 0", [100, 100, 100, 100, 100]),
        ("once[0,1] a > 0", [100, 100, -1, 5, 5]),
        ("once[1,2] a > 0", [-np.inf, 100, 100, -1, 5]),
        ("a > 0 since b > 0", [20, -1, 10, 5, -1]),
        ("a > 0 since[0,1] b > 0", [20, -1, 10, 5, -1]),
        ("rise(a > 0)", [100, -100, -2, 2, -5]),
        ("fall(a > 0)", [-100, 1, -1, -5, 1]),
    ],
)
def test_the_values_that_rtamt_expects_of_its_own_operators(text, values):
    """The two traces and the values of its test suite, where ours is not another operator (its iff is -|a - b|)."""
    signals = {"a": np.array([[100.0, -1, -2, 5, -1]]), "b": np.array([[20.0, -2, 10, 4, -1]])}
    spec = parse_spec(f"signal a\nsignal b\nspec: {text}")
    np.testing.assert_array_equal(spec.robustness_over_time(signals), [values])
