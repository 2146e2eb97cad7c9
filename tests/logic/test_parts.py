"""Clauses and named sub-formulas of many trajectories, against what explains each of them alone."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from strategies import DECLARED, batches, formulas

from tltlrl.logic import parse_spec

TEXTS = {
    "a conjunction": "F G at & G safe",
    "no conjunction": "F (at & X[!] !at)",
    "until": "(safe U at) & !(F (!safe)) & (at T !at)",
    "the past": "G (at => once safe) & (safe since at)",
    "a truncated left operand": "((F at) U !safe) & G safe",
    "nothing named": "G x < 3 & F x > 1",
    "the end": "G (at => X[!] safe) & F[7,9] safe",
    "no time": "(x > 0.3 | at) & !safe & (safe | F at)",
}


def spec_of(text):
    return parse_spec(f"signal x\ndef at: x > 0.8\ndef safe: x > -0.5 | y > 0\nsignal y\nspec: {text}")


@pytest.mark.parametrize("whole", [True, False], ids=["of one length", "of many lengths"])
@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
def test_parts_are_what_each_trajectory_is_explained_by(text, whole):
    spec, rng = spec_of(text), np.random.default_rng(3)
    signals = {"x": rng.standard_normal((40, 9)), "y": rng.standard_normal((40, 9))}
    signals = {name: signals[name] for name in spec.signals}
    lengths = np.full(40, 9) if whole else rng.integers(1, 10, 40)
    parts, clauses = spec.parts(signals, lengths), spec.clauses(signals, lengths)
    robustness, why = spec.robustness(signals, lengths), spec.explain(signals, lengths)
    assert list(parts.clauses) == list(clauses)
    for clause, values in clauses.items():
        np.testing.assert_array_equal(parts.clauses[clause], values)
    np.testing.assert_array_equal(np.stack(list(clauses.values()))[parts.clause, np.arange(40)], robustness)
    np.testing.assert_array_equal(parts.robustness, robustness)
    some, of_some = parts.of_first(7), spec.parts({name: values[:7] for name, values in signals.items()}, lengths[:7])
    np.testing.assert_equal(dataclasses.asdict(some), dataclasses.asdict(of_some))
    over_time = spec.definitions_over_time(signals, lengths)
    for name, values in over_time.items():
        np.testing.assert_array_equal(parts.highest[name], np.nanmax(values, axis=1))
        np.testing.assert_array_equal(parts.lowest[name], np.nanmin(values, axis=1))
    names = [list(spec.definitions)[i] if i >= 0 else None for i in parts.name]
    if "F at) U" not in text:  # there the way ends at the U
        assert names == [each.name for each in why]


def test_a_clause_asks_for_what_stands_in_it_under_no_negation():
    spec = spec_of("(!safe U at) & G !at & (at => F safe)")
    assert dict(spec.asks_for) == {"!safe U at": ("at",), "G !at": (), "at => F safe": ("safe",)}


@settings(deadline=None)
@given(formulas(), batches())
def test_the_least_conjunct_is_the_robustness(formula, batch):
    signals, lengths = batch
    spec = parse_spec(DECLARED + str(formula))
    conjuncts = spec.conjuncts(signals, lengths)
    np.testing.assert_array_equal(conjuncts.min(axis=1), spec.robustness(signals, lengths))


def test_conjuncts_are_the_members_of_families_and_conjunctions_also_under_g():
    declared = "signal x\nsignal y\nconst c[a] = 1\nconst c[b] = 2\ndef low[i in a, b]: x < c[i]\n"
    nested = (
        "def safe: y > 0 & (all i in a, b: low[i])\nspec: G safe & (all i in a, b: F low[i]) & G[2,3] (x > 0 & F y > 1)"
    )
    plain = "spec: G y > 0 & G low[a] & G low[b] & F low[a] & F low[b] & G[2,3] x > 0 & G[2,3] F y > 1"
    rng = np.random.default_rng(0)
    signals, lengths = {name: rng.normal(size=(30, 7)) for name in "xy"}, rng.integers(1, 8, 30)
    expected = np.stack(list(parse_spec(declared + plain).clauses(signals, lengths).values()), axis=1)
    np.testing.assert_array_equal(parse_spec(declared + nested).conjuncts(signals, lengths), expected)
    normalised = parse_spec(declared + nested).normalised(signals, lengths)
    assert normalised.conjuncts(signals, lengths).shape == expected.shape
    np.testing.assert_array_equal(
        normalised.conjuncts(signals, lengths).min(axis=1), normalised.robustness(signals, lengths)
    )
