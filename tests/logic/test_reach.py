"""Windows beyond the end of a trajectory, found before anything runs."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import SIGNALS, formulas

from tltlrl.logic import SpecError, parse_spec

STEPS = 200


def told(formula, steps=STEPS):
    """What is said of a formula on trajectories of so many samples."""
    spec = parse_spec(f"signal x\nspec: {formula}")
    try:
        spec.check_length({"x": np.zeros((1, steps))})
    except SpecError as error:
        line = error.source.text.split("\n")[error.span.line - 1]
        return error.problem.split()[0], line[error.span.column - 1 : error.span.end_column - 1]
    return None


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("G[300,320] x > 0", ("every", "G[300,320] x > 0")),
        ("F[300,320] x > 0", ("no", "F[300,320] x > 0")),
        ("F x > 1 & G[300,320] x > 0", ("every", "G[300,320] x > 0")),
        ("x > 1 | F[200,200] x > 0", ("no", "F[200,200] x > 0")),
        ("G (x > 0 => F[300,310] x < 1)", ("no", "F[300,310] x < 1")),
        ("!(F x > 0 & F[200,210] x < 1)", ("no", "F[200,210] x < 1")),
        ("x > 0 U[300,310] x < 1", ("no", "x > 0 U[300,310] x < 1")),
        ("F x > 0 & G[250,inf] x < 1", ("every", "G[250,inf] x < 1")),
        ("F (G[5,40] x > 0)", ("every", "F (G[5,40] x > 0")),  # satisfied at the last sample, where G sees none
        ("G[150,320] x > 0", None),
        ("G (x > 0 => F[0,40] x < 1)", None),
        ("F (G[0,40] x > 0)", None),
        ("F[199,199] x > 0 & X x > 0", None),
        ("G x > 0 & G[1,1] x < 1", None),
        ("G F[0,300?] x > 0", ("every", "F[0,300?] x > 0")),
        ("F G[0,300!] x > 0", ("no", "G[0,300!] x > 0")),
        ("F once[300,310] x > 0", ("no", "once[300,310] x > 0")),
        ("F[0, 3] rise(x > 0) & G F[0,30?] x > 0", None),
        ("F holds(x > 0)", None),  # +inf or -inf, as the trajectory is
    ],
)
def test_a_part_that_the_length_alone_decides_is_told(formula, said):
    assert told(formula) == said


def test_the_message_says_where_and_what_to_do():
    spec = parse_spec("signal x\nspec: F x > 1 & G[300,320] x > 0", name="mine.tltl")
    with pytest.raises(SpecError) as error:
        spec.check_length({"x": np.zeros((1, STEPS))})
    assert str(error.value) == (
        "mine.tltl:2:17: every trajectory of 200 samples satisfies this, whatever it does; expected windows that begin "
        "by the last sample, step 199; lower the bounds, or make the episode longer\n"
        "    2 | spec: F x > 1 & G[300,320] x > 0\n"
        "      |                 ^~~~~~~~~~~~~~~~"
    )


@settings(max_examples=150)
@given(formulas(truths=False), st.integers(1, 5), st.integers(0, 2**32 - 1))
def test_whatever_is_infinite_is_told_and_told_of_every_trajectory(formula, steps, seed):
    rng = np.random.default_rng(seed)
    spec = parse_spec("signal x\nsignal y\nsignal z\nsignal w\nspec: " + str(formula))

    def of(signals):
        try:
            spec.check_length(signals)
        except SpecError as error:
            return error.span, error.problem
        return None

    one, other = ({name: rng.normal(size=(1, steps)) for name in (*SIGNALS, "w")} for _ in range(2))
    assert of(one) == of(other)
    if np.isinf(spec.robustness(one)).any():
        assert of(one) is not None
