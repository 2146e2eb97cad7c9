"""Random formulas and random batches of trajectories, for hypothesis."""

import numpy as np
from hypothesis import strategies as st

from tltlrl.logic import syntax as s

SIGNALS = ("x", "y", "z")
DECLARED = "signal x\nsignal y\nsignal z\nsignal w\nsignal b: bool\nspec: "
# Multiples of 1/4 keep all arithmetic exact and make ties, the hard case for explanations, common.
quarters = st.integers(-12, 12).map(lambda n: n / 4)


def constant(value):
    return s.Number(value) if value >= 0 else s.Negative(s.Number(-value))


numbers = st.recursive(
    st.sampled_from(SIGNALS).map(s.Name),
    lambda inner: st.one_of(
        st.builds(s.Arithmetic, st.sampled_from("+-*"), inner, quarters.map(constant)),
        st.builds(s.Negative, inner),
        inner.map(lambda a: s.Call("abs", (a,))),
        st.tuples(inner, inner).map(lambda pair: s.Call("max", pair)),
        inner.map(lambda a: s.Call("previous", (a,))),
        st.builds(lambda name, a: s.Call(name, (a,)), st.sampled_from(["sign", "floor"]), inner),
        st.tuples(inner, inner).map(lambda pair: s.Call("norm", (s.Vector(pair),))),
        st.tuples(inner, quarters.map(constant)).map(lambda v: s.Call("dot", (s.Vector(v), s.Vector(v[::-1])))),
        st.builds(lambda a: s.Call("mod", (a, s.Number(0.75))), inner),
        st.builds(lambda a, low: s.Call("clip", (a, constant(low), s.Number(3.0))), inner, quarters),
    ),
    max_leaves=2,
)
comparisons = st.one_of(
    st.builds(lambda a, o, c: s.Comparison((a, constant(c)), (o,)), numbers, st.sampled_from("<>"), quarters),
    st.builds(
        lambda c, a, b: s.Comparison((constant(c), a, b), ("<=", "<")),
        quarters,
        numbers,
        st.just(s.Name("w")),
    ),
)
xy, zw = (s.Vector((s.Name(a), s.Name(b))) for a, b in ("xy", "zw"))
regions = st.one_of(
    st.just(s.Call("ball", (xy, zw, s.Number(1.5)))),
    st.builds(
        lambda a, b: s.Call("box", (xy, s.Vector((constant(a), s.Name("z"))), s.Vector((s.Number(4.0), constant(b))))),
        quarters.filter(lambda a: a < 4),
        quarters,
    ),
)
predicates = st.one_of(comparisons, comparisons, comparisons, regions)
truth_values = st.one_of(st.booleans().map(s.Boolean), st.just(s.Name("b")))
intervals = st.tuples(st.integers(0, 4), st.integers(0, 6)).map(
    lambda ab: s.Interval(s.Number(float(ab[0])), s.Number(float(sum(ab))))
)
endless = st.integers(0, 4).map(lambda a: s.Interval(s.Number(float(a)), s.Infinity()))
maybe = st.none() | intervals | endless


def marked(mark):
    return maybe | intervals.map(lambda w: s.Interval(w.lower, w.upper, mark))


def _compound(inner, calls):
    several = st.lists(inner, min_size=2, max_size=3).map(tuple)
    return st.one_of(
        st.builds(s.Not, inner),
        st.builds(s.And, several),
        st.builds(s.Or, several),
        st.builds(s.Implies, inner, inner),
        st.builds(s.Iff, inner, inner),
        st.builds(s.Next, inner, st.booleans()),
        st.builds(s.Always, inner, marked("!")),
        st.builds(s.Eventually, inner, marked("?")),
        st.builds(s.Until, inner, inner, marked("?")),
        st.builds(s.Release, inner, inner, marked("!")),
        st.builds(s.WeakUntil, inner, inner, maybe),
        st.builds(s.Then, inner, inner, maybe),
        st.builds(s.Xor, inner, inner),
        st.builds(s.Previous, inner),
        st.builds(s.Once, inner, maybe),
        st.builds(s.Historically, inner, maybe),
        st.builds(s.Since, inner, inner, maybe),
        st.builds(lambda k, p: s.Call(k, (p,)), st.sampled_from(calls), inner),
        st.builds(lambda k, p: s.ForEach(k, "i", ("r", "g"), p), st.sampled_from(["all", "any"]), inner),
    )


def formulas(max_leaves=5, truths=True):
    """Random formulas of every operator; without truths, only the end and the start make a value infinite."""
    calls = ["rise", "fall", "previous", *["holds"] * truths]
    leaves = st.one_of(predicates, predicates, predicates, truth_values) if truths else predicates
    return st.recursive(leaves, lambda inner: _compound(inner, calls), max_leaves=max_leaves).filter(_binds_once)


def _binds_once(f, bound=False):
    if isinstance(f, s.ForEach):
        return not bound and _binds_once(f.body, True)
    return all(_binds_once(child, bound) for child in s.children(f))


@st.composite
def batches(draw, max_count=3, max_steps=9):
    """Signals and lengths: ragged, with NaN after each trajectory's end."""
    count, steps = draw(st.integers(1, max_count)), draw(st.integers(1, max_steps))
    seed = draw(st.integers(0, 2**32 - 1))
    generator = np.random.default_rng(seed)
    lengths = generator.integers(1, steps + 1, count)
    signals = {}
    for name in (*SIGNALS, "w"):
        values = generator.integers(-12, 13, (count, steps)) / 4
        values[np.arange(steps) >= lengths[:, None]] = np.nan
        signals[name] = values
    signals["b"] = np.where(np.arange(steps) < lengths[:, None], generator.integers(0, 2, (count, steps)), np.nan)
    return signals, lengths
