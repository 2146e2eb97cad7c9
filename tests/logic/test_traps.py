"""Traps of the manual are told, where they are, and nothing else is."""

import numpy as np
import pytest

from tltlrl.logic import load_spec, parse_spec
from tltlrl.resources import SPECS


@pytest.mark.parametrize(
    ("formula", "column", "told"),
    [
        ("F G x < 1", 1, "'F G x < 1' is 'x < 1' at the last sample"),
        ("G F x < 1", 1, "'G F x < 1' is 'x < 1' at the last sample"),
        ("!G F x < 1", 2, "'G F x < 1' is 'x < 1' at the last sample"),
        ("G F[0,5] x < 1", 3, "after the end counts as not met; write F[0, 5?] if it is to count as met"),
        ("G (x < 1 => F[0,3] y < 1)", 13, "write F[0, 3?]"),
        ("G (x < 1 U[0,3] y < 1)", 4, "write U[0, 3?]"),
        ("x < 1 R F[0,3] y < 1", 9, "write F[0, 3?]"),
        ("!F G[0,3] x < 1", 4, "write G[0, 3!]"),
        ("!F !F[0,5] x < 1", 5, "write F[0, 5?]"),
        ("F (G[0,40] x < 1)", 4, "after the end counts as met; write G[0, 40!] if it is to count as not met"),
        ("F (x < 1 R[0,40] y < 1)", 4, "write R[0, 40!]"),
        ("x < 1 U G[0,3] y < 1", 9, "write G[0, 3!]"),
        ("F X x < 1", 3, "'X x < 1' holds at the last sample, whatever is asked; write X[!]"),
        ("!G !X x < 1", 5, "'X x < 1' holds at the last sample"),
        ("G X[!] x < 1", 3, "'X[!] x < 1' fails at the last sample"),
        ("X x < 1", 1, "on a trajectory that ends there, 'X x < 1' holds with the value +inf"),
        ("G (x < 1 => X G !x < 1)", 1, "'x < 1' may hold at one sample only"),
        ("F x < 1 & G (x < 1 => X y < 1)", 11, "if it must follow, add F (x < 1 & X[!] y < 1)"),
        ("F x < 1 & G (x < 1 => X y < 1) & F (x < 1 & X[!] y < 1)", 0, ""),
        ("F x < 1 & G (x < 1 => X y < 1) & F (X[!] y < 1 & x < 1)", 0, ""),
        ("F x < 1 & G (x < 1 => X y < 1) & F (x < 1 & X[!] true)", 0, ""),
        ("F (x < 1 & y < 1) & G (x < 1 & y < 1 => X y > 1) & F (x < 1 & y < 1 & X[!] y > 1)", 0, ""),
        ("F (x < 1 & X[!] y < 1) & G (x < 1 & X[!] y < 1 => X y > 1)", 0, ""),
        ("F x < 1 & G (x < 1 => X X y < 1)", 11, "if it must follow, add F (x < 1 & X[!] X[!] y < 1)"),
        ("signal x\ndef p: F[0,5] x < 1\nspec: G p", 8, "write F[0, 5?]"),
        ("signal x\ndef p[i in a, b]: F[0,5] x < 1\nspec: all i in a, b: G p[i]", 19, "write F[0, 5?]"),
        ("F[0,3] x < 1 xor G y < 1", 0, ""),
        ("G (x < 1 => X y < 1)", 0, ""),
        ("F[0,3] x < 1", 0, ""),
        ("G F[0,3?] x < 1", 0, ""),
        ("F G[0,3!] x < 1", 0, ""),
        ("G F[3,inf] x < 1 & G once[0,3] x < 1", 0, ""),
        ("G !F[0,3] x < 1", 0, ""),
        ("F (x < 1 & X[!] F y < 1)", 0, ""),
        ("x < 1 T y < 1", 0, ""),
    ],
)
def test_traps(formula, column, told):
    traps = parse_spec(formula).traps
    assert [trap.column for trap in traps] == [column] * bool(told)
    assert all(told in trap.text for trap in traps)


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("reach_avoid", 1),
        ("visit_in_order", 1),
        ("toast", 0),
        ("toast_eq37", 1),
        ("toast_smooth", 0),
        ("toast_gentle", 0),
    ],
)
def test_traps_of_the_specs(name, count):
    assert len(load_spec(SPECS / f"{name}.tltl").traps) == count


def test_what_may_hold_at_the_last_sample_alone_must_be_followed_once_the_advice_is_taken():
    formula = "F x < 1 & G (x < 1 => X y < 1)"
    (trap,) = parse_spec(formula).traps
    mended = parse_spec(f"{formula} & {trap.text.split('add ')[1]}")
    assert not mended.traps
    for x, y, satisfied in (([2, 2, 0], [9, 9, 9], (True, False)), ([2, 0, 2], [9, 9, 0], (True, True))):
        signals = {"x": np.array([x], float), "y": np.array([y], float)}
        assert tuple(spec.robustness(signals)[0] > 0 for spec in (parse_spec(formula), mended)) == satisfied
