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
