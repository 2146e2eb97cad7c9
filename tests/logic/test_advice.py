"""Advice is right: who follows it writes a spec that parses and means what was asked."""

import numpy as np
import pytest

from tltlrl.logic import SpecError, TraceError, parse_spec


def value(text):
    """Robustness on trajectories of signals that are near 0 and 1, or points near the origin."""
    spec = parse_spec(text)
    generator = np.random.default_rng(0)
    signals = {
        name: generator.integers(0, 2, (50, 12))
        if name == "hit"
        else generator.normal(size=(50, 12) if dimension is None else (50, 12, dimension))
        for name, dimension in sorted(spec.signals.items())
    }
    return spec.robustness(signals).tolist()


# What was written, what is told, what is written after that, and another way to say what was asked.
CASES = [
    ("period 1\nF[0, 2 s] x > 0", "write it with its unit", "period 1 s\nF[0, 2 s] x > 0", "F[0,2] x > 0"),
    ("F[0, 0.5] x > 0", "seconds are written with their unit", "period 0.1 s\nF[0, 0.5 s] x > 0", "F[0,5] x > 0"),
    ("G x > 1 s", "divide it by 1 s", "G x > 1 s / 1 s", "G x > 1"),
    (
        "F[0, 2 s] x > 0",
        "write for instance 'period 0.05 s' into the spec",
        "period 0.5 s\nF[0, 2 s] x > 0",
        "F[0,4] x > 0",
    ),
    ("G !collision", "compare it, as in collision > 0.5", "G !collision > 0.5", "G collision < 0.5"),
    (
        "signal hit\nsignal x\nspec: hit => F x > 0",
        "declare it so, as in 'signal hit: bool'",
        "signal hit: bool\nsignal x\nspec: hit => F x > 0",
        "signal hit\nsignal x\nspec: holds(hit > 0.5) => F x > 0",
    ),
    ("signal hit: float\nspec: hit > 1", "delete what begins with the colon", "signal x\nspec: x > 1", "x > 1"),
    ("G[0,3?] x > 0", "unless you write [0, 3!]", "G[0,3!] x > 0", "!F[0,3?] x < 0"),
    ("F[0,3!] x > 0", "unless you write [0, 3?]", "F[0,3?] x > 0", "!G[0,3!] x < 0"),
    (
        "signal ee[2]\nspec: G ee",
        "as in norm(ee) < 1",
        "signal ee[2]\nspec: G norm(ee) < 1",
        "G distance(ee, (0, 0)) < 1",
    ),
    ("alw_[0,5] x < 1", "'alw_' is written G", "G[0,5] x < 1", "!F[0,5] x > 1"),
    ("ev_[0,5] (x < 1)", "'ev_' is written F", "F[0,5] (x < 1)", "!G[0,5] x > 1"),
    ("F[0, 5) x < 1", "[0, 5) is [0, 4]", "F[0, 4] x < 1", "!G[0,4] x > 1"),
    (
        "signal x\nlet c = G x < 1\nspec: c",
        "name a formula by 'def c: ...'",
        "signal x\ndef c: G x < 1\nspec: c",
        "G x < 1",
    ),
    ("G x < inf", "infinity can only end an interval", "G x < 1e300", "G x - 1e300 < 0"),
    ("signal inf\nspec: inf < 1", "such as 'inf_'", "signal inf_\nspec: inf_ < 1", "x < 1"),
    ("signal x : float\nspec: x < 1", "delete what begins with the colon", "signal x\nspec: x < 1", "x < 1"),
    ("Always(x < 1)", "'Always' is written G", "G (x < 1)", "!F x > 1"),
    (
        "const limit = 3 m\nsignal x\nspec: x < limit",
        "times alone have a unit (s, ms, min): write '# m', a comment",
        "const limit = 3 # m\nsignal x\nspec: x < limit",
        "x < 3",
    ),
    (
        "signal ped[2][2]\nspec: norm(ped[1]) < 1",
        "or a family, as 'signal a[i in 1..3][2]'",
        "signal a[i in 0..1][2] spec: norm(a[1]) < 1",
        "signal a[2] signal b[2] spec: distance(b, (0, 0)) < 1",
    ),
    (
        "signal x\nphi := G x > 0\nspec: phi",
        "name a formula by 'def phi: ...'",
        "signal x\ndef phi: G x > 0\nspec: phi",
        "G x > 0",
    ),
    (
        "phi := G x > 0\nspec: phi",
        "name a formula by 'def phi: ...'",
        "signal x\ndef phi: G x > 0\nspec: phi",
        "G x > 0",
    ),
    (
        "c = always(x > 0)",
        "begin the formula that is the spec with 'spec:'",
        "signal x spec: G (x > 0)",
        "G x > 0",
    ),
    ("signal x\nspeed = 2 * x\nspec: speed < 1", "by 'let speed = ...'", "signal x\nlet v = 2 * x\nspec: v < 1", None),
    (
        "norm(a - b) < 1",
        "'signal a[2] signal b[2] spec: ...'",
        "signal a[2] signal b[2] spec: norm(a - b) < 1",
        "distance(a, b + (0, 0)) < 1",
    ),
    ("norm(a) < 1", "'signal a[2] spec: ...'", "signal a[2] spec: norm(a) < 1", "distance(a, (0, 0)) < 1"),
    ("x > 0 ==> y > 0", "'implies' is written =>", "x > 0 => y > 0", "!x > 0 | y > 0"),
    ("GF x < 1", "write the operators apart, as G F", "G F x < 1", "G (F x < 1)"),
    ("GF (x < 1)", "write the operators apart, as G F", "G F (x < 1)", "G (F x < 1)"),
    ("XX x < 1", "write the operators apart, as X X", "X X x < 1", "X (X x < 1)"),
    ("x\u00a0< 1", "write a plain one or delete it", "x < 1", None),
    ("x\u200b < 1", "write a plain one or delete it", "x < 1", None),
    ("x < 1\nspec: x < 1", "", "signal x\nspec: x < 1", None),
    ("signal x\nx < 1\nspec: x < 2", "delete it or begin it with", "signal x\ndef p: x < 1\nspec: x < 2", "x < 2"),
    ("max < 1", "write max(...)", "max(x, y) < 1", "x < 1 & y < 1"),
    ("x == 1", "write abs(a - b) < tolerance", "abs(x - 1) < 0.1", "0.9 < x < 1.1"),
]


@pytest.mark.parametrize(("mistake", "told", "followed", "meant"), CASES)
def test_who_follows_the_advice_says_what_was_meant(mistake, told, followed, meant):
    with pytest.raises((SpecError, TraceError)) as found:
        parse_spec(mistake).robustness({"x": [[1.0]]})
    assert told in str(found.value).split("\n")[0]
    assert value(followed) == pytest.approx(value(meant or followed))


@pytest.mark.parametrize("text", ["F[2, inf] x > 0", "F[2,inf) x > 0", "F[2, ∞) x > 0", "X[!] X[!] F x > 0"])
def test_a_window_without_end(text):
    spec = parse_spec(text)
    assert spec.horizon is None
    assert spec.robustness({"x": [[3, 2, 1, 0.5, 0.75]]}) == [1]
    assert spec.robustness({"x": [[3, 2]]}) == [-np.inf]
    assert parse_spec("G[2, inf] x > 0").robustness({"x": [[3, -2]]}) == [np.inf]
    assert parse_spec("F[0, inf] x > 0").robustness({"x": [[3, -2]]}) == [3]
