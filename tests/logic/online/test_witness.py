"""What decides, told while a trajectory runs."""

import numpy as np
from hypothesis import given, settings
from strategies import SIGNALS, formulas
from test_monitor import DECLARED, samples, seeds

from tltlrl.logic import parse_spec


@given(formulas(), seeds)
@settings(deadline=None, max_examples=60)
def test_the_predicate_told_has_the_deciding_margin_at_its_step(formula, seed):
    spec, signals = parse_spec(DECLARED + str(formula)), samples(seed, 1)
    witness = spec.watch()
    for t in range(signals["x"].shape[1]):
        reading = witness.update({name: values[0, t] for name, values in signals.items()})
        why = witness.explanation()
        assert why.value == reading.robustness[0]
        assert why.step <= t
        if why.predicate is None:
            assert np.isinf(why.value)
            continue
        assert why.value == (-why.margin if why.negated else why.margin)
        until = {name: values[:, : why.step + 1] for name, values in signals.items()}
        predicate = parse_spec(DECLARED + why.predicate)
        assert predicate.robustness_over_time(until)[0, why.step] == why.margin


@given(formulas(), seeds)
@settings(deadline=None, max_examples=40)
def test_the_step_told_is_that_of_a_whole_explanation(formula, seed):
    """Where no two numbers are the same."""
    spec, signals = parse_spec(DECLARED + str(formula)), samples(seed, 1, 5)
    noise = np.random.default_rng(seed)
    signals |= {name: signals[name] + noise.normal(scale=0.01, size=(1, 5)) for name in SIGNALS}
    witness = spec.watch()
    for t in range(5):
        witness.update({name: values[0, t] for name, values in signals.items()})
        why = witness.explanation()
        (whole,) = spec.explain({name: values[:, : t + 1] for name, values in signals.items()})
        assert (why.value, why.step, why.margin is None) == (whole.value, whole.step, whole.margin is None)


def test_the_end_may_be_that_of_the_part_on_which_a_left_operand_is_read():
    spec = parse_spec("signal x\nspec: (F[1,1] x > 0) U[2,2] x > 0")  # the left operand lacks a sample at step 1
    witness = spec.watch()
    for t in range(5):
        witness.update({"x": 1.0})
        why, (whole,) = witness.explanation(), spec.explain({"x": np.ones((1, t + 1))})
        assert (why.step, why.edge, why.value) == (whole.step, whole.edge, whole.value) == (min(t, 1), "end", -np.inf)


def test_names_and_places_are_those_of_a_whole_explanation():
    spec = parse_spec("signal x\nsignal y\ndef low: x < 1\ndef near: low & y > 0\nspec: F G near & G !(y > 5)")
    signals = {"x": np.array([[0.0, 3, 0.5]]), "y": np.array([[1.0, 1, 7]])}
    witness = spec.watch()
    for t in range(3):
        witness.update({name: values[:, t] for name, values in signals.items()})
        why = witness.explanation()
        (whole,) = spec.explain({name: values[:, : t + 1] for name, values in signals.items()})
        assert str(why) == str(whole)
