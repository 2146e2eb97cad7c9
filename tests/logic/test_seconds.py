"""Bounds in seconds: the same windows as in steps, once it is known how far apart the samples are."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tltlrl.logic import SpecError, TraceError, load_spec, parse_spec

X = {"x": np.random.default_rng(0).normal(size=(20, 60))}


@settings(deadline=None, max_examples=100)
@given(
    st.sampled_from(["F{} x > 0", "G{} x > 0", "x < 1 U{} x > 1", "x < 1 R{} x > -1", "(F x > 1) U{} x > 1"]),
    st.integers(0, 20),
    st.integers(0, 20),
    st.sampled_from([0.05, 0.02, 0.1, 0.3, 1 / 3, 1.0, 0.004]),
)
def test_a_window_in_seconds_is_that_in_steps(text, lower, width, period):
    upper = lower + width
    steps = parse_spec(text.format(f"[{lower}, {upper}]"))
    seconds = parse_spec(text.format(f"[{lower * period!r} s, {upper * period!r} s]"), period=period)
    assert seconds.robustness(X).tolist() == steps.robustness(X).tolist()
    assert seconds.horizon == steps.horizon


def test_durations_are_constants_and_sums():
    text = """
    const settle = 1.5 s
    const wait[a] = 200 ms
    let late = 2 * settle - wait[a]
    signal x
    spec: G[settle, late] x > 0 & F[0, late / 1.4 s] x > 0
    """
    spec = parse_spec(text, period=0.1)
    assert spec.horizon == 28
    assert spec.robustness(X).tolist() == parse_spec("G[15, 28] x > 0 & F[0, 2] x > 0").robustness(X).tolist()


def test_the_period_is_in_the_text_or_given():
    inside = parse_spec("period 50 ms\nF[0, 1 s] x > 0")
    given_ = parse_spec("F[0, 1 s] x > 0", period=0.05)
    assert inside == given_ == parse_spec("F[0, 1 s] x > 0").sampled(0.05)
    assert inside.period == 0.05
    assert inside.horizon == 20
    for spec in (inside, given_):
        assert parse_spec(str(spec)) == spec == pickle.loads(pickle.dumps(spec))
    assert inside.sampled(0.05) == inside
    with pytest.raises(SpecError, match=r"<spec>:1:1: the samples are 0.1 s apart, but the spec says 0.05 s"):
        inside.sampled(0.1)
    assert given_.sampled(0.1).horizon == 10


def test_a_spec_without_seconds_goes_with_any_period():
    spec = parse_spec("F[0,3] x > 0")
    assert spec.sampled(0.05) is spec
    assert not spec.counts_seconds


def test_without_a_period_a_spec_is_read_but_not_evaluated():
    spec = parse_spec("signal x\nconst late = 2 s\nspec: F[0, late] x > 0")
    assert spec.signals == {"x": None}
    assert spec.durations == {"late"}
    assert spec.period is None
    for evaluate in (spec.robustness, spec.robustness_over_time, spec.explain, spec.definitions_over_time):
        with pytest.raises(TraceError, match=r"<spec>:3:12: the bound is in seconds, and how far apart samples are"):
            evaluate({"x": [[1.0]]})
    with pytest.raises(SpecError, match="how far apart samples are is not known"):
        _ = spec.horizon


def test_overrides_of_durations_are_in_seconds(tmp_path):
    (tmp_path / "task.tltl").write_text("const late = 2000 ms\nsignal x\nspec: F[0, late] x > 0")
    spec = load_spec(tmp_path / "task.tltl", {"late": 3}, period=0.5)
    assert spec.constants == {"late": 3.0}
    assert spec.horizon == 6
    assert "const late = 3 s" in str(spec)
    assert spec.sampled(0.5) == spec == parse_spec(str(spec))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("F[0, 0.12 s] x > 0", "the bound is 0.12 s, and samples are 0.05 s apart; expected a whole number of samples; "
         "write 0.1 s or 0.15 s"),
        ("F[2, 3 s] x > 0", "one bound is in steps and one in seconds: 2, 3 s"),
        ("F[3 s, 1 s] x > 0", "the interval is reversed: 3 s is greater than 1 s"),
        ("F[0, 2 s * 3 s] x > 0", "'2 s * 3 s' is neither a duration nor a number"),
        ("F[0, 2 / 1 s] x > 0", "'2 / 1 s' is neither a duration nor a number"),
        ("F[0, (1 s) ** 2] x > 0", "is neither a duration nor a number"),
        ("F[0, 1 s + 1] x > 0", "found a scalar; expected a duration, as '1 s' is"),
        ("F[0, 1 s - 2 s] x > 0", "the bound is -1 s; expected 0 s or more"),
        ("F[0, norm((1 s, 2 s)) ] x > 0", "found a duration; expected a number"),
        ("period 0 s\nx > 0", "the period is 0 s; expected more than 0"),
        ("signal x\nperiod 1 s\nperiod 1 s\nspec: x > 0", "the period is given twice"),
    ],
)  # fmt: skip
def test_mistakes(text, told):
    with pytest.raises(SpecError) as found:
        parse_spec(text, period=0.05 if "period" not in text else None)
    assert told in str(found.value)


@pytest.mark.parametrize("period", [0, -1, float("nan"), float("inf"), "0.05", True])
def test_a_period_that_is_none(period):
    with pytest.raises(SpecError, match=r"the period given is .*; expected seconds, more than 0"):
        parse_spec("F[0, 1 s] x > 0", period=period)


def test_period_stays_a_name():
    assert parse_spec("signal period\nspec: period < 1").robustness({"period": [[0.0]]}) == [1]
    assert parse_spec("period < 1").signals == {"period": None}
