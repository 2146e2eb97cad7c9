"""The evaluator against the definition, and the laws that follow from the definition."""

import re
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import robustness
from strategies import DECLARED, batches, comparisons, formulas

from tltlrl.logic import TraceError, parse_spec, scans
from tltlrl.logic import syntax as s


def declared(f):
    return parse_spec(DECLARED + str(f))


def cut(signals, row, length):
    return {name: values[row : row + 1, :length] for name, values in signals.items()}


@settings(deadline=None, max_examples=300)
@given(formulas(), batches())
def test_every_value_is_that_of_the_definition(f, batch):
    signals, lengths = batch
    spec = declared(f)
    values = spec.robustness(signals, lengths)
    over_time = spec.robustness_over_time(signals, lengths)
    for row, length in enumerate(lengths):
        trace = {name: array[row].tolist() for name, array in signals.items()}
        expected = [robustness(f, trace, t, length) for t in range(length)]
        assert values[row] == expected[0]
        assert over_time[row, :length].tolist() == expected
        assert np.isnan(over_time[row, length:]).all()


@settings(deadline=None, max_examples=300)
@given(formulas(), batches(max_count=4, max_steps=30))
def test_a_row_of_a_ragged_batch_is_the_trajectory_alone(f, batch):
    signals, lengths = batch
    spec = declared(f)
    together = spec.robustness(signals, lengths)
    over_time = spec.robustness_over_time(signals, lengths)
    assert together.tolist() == over_time[:, 0].tolist()
    for row, length in enumerate(lengths):
        alone = cut(signals, row, length)
        assert spec.robustness(alone)[0] == together[row]
        assert spec.robustness_over_time(alone)[0].tolist() == over_time[row, :length].tolist()


@settings(deadline=None, max_examples=300)
@given(formulas(), batches())
def test_explanations_name_what_decides(f, batch):
    signals, lengths = batch
    spec = declared(f)
    for row, (value, why) in enumerate(
        zip(spec.robustness(signals, lengths), spec.explain(signals, lengths), strict=True)
    ):
        assert why.value == value
        assert 0 <= why.step < lengths[row]
        if why.predicate is None:
            assert np.isinf(value)
            continue
        assert value == (-why.margin if why.negated else why.margin)
        predicate = parse_spec(DECLARED + why.predicate)
        assert predicate.robustness_over_time(signals, lengths)[row, why.step] == why.margin
        line = spec.text.split("\n")[why.line - 1]
        assert line[why.column - 1 :].replace("(", "").startswith(why.predicate.split()[0].replace("(", ""))


@settings(deadline=None, max_examples=200)
@given(formulas(), batches(max_count=1))
def test_the_margin_told_is_that_of_the_formula_shown(f, batch):
    signals, lengths = batch
    (why,) = declared(f).explain(signals, lengths)
    if why.predicate is not None:
        shown, margin = re.fullmatch(r"at step \d+ by (.*), margin (\S+)", why.decided_by).groups()
        value = parse_spec(DECLARED + shown).robustness_over_time(signals, lengths)[0, why.step]
        assert margin == f"{value + 0.0:+.6g}"


@pytest.mark.parametrize(
    ("text", "predicate", "name", "line"),
    [
        ("const a = 1\nconst b = 1\ndef low: x < a\ndef high: x < b\nspec: F high", "x < b", "high", 5),
        ("def unused: x < 1\nspec: F x < 1", "x < 1", None, 3),
        ("def a: x < 1 & x < 2\ndef b: x < 1\nspec: a", "x < 1", "a", 2),
        ("def a: x < 1\ndef b: a\nspec: x < 2 & b", "x < 1", "a", 2),
        ("def a: !(x < 1)\nspec: !a", "x < 1", "a", 2),
        ("def unused: x < 1 & x < 2\nspec: x < 1 & x < 2", "x < 1", None, 3),
    ],
)
def test_of_equal_predicates_the_one_on_the_way_is_named(text, predicate, name, line):
    (why,) = parse_spec(f"signal x\n{text}").explain({"x": [[0.25]]})
    assert (why.predicate, why.name, why.line) == (predicate, name, line)


def test_an_expression_without_a_value_is_told_where_the_formula_has_it():
    spec = parse_spec("signal x\ndef unused: 1 / x < 1\nspec: F 1 / x < 2")
    for evaluate in (spec.robustness, spec.robustness_over_time, spec.explain):
        with pytest.raises(TraceError, match=r"<spec>:3:9: '1 / x' has no finite value"):
            evaluate({"x": [[0.0]]})
    with pytest.raises(TraceError, match=r"<spec>:2:13: '1 / x' has no finite value"):
        parse_spec("signal x\ndef unused: 1 / x < 1\nspec: x < 2").explain({"x": [[0.0]]})


@pytest.mark.parametrize("text", ["norm(p) < 1e-190", "F norm(p) < 1e-190", "G distance(p, (0, 0)) > 1e-190"])
def test_the_norm_of_tiny_numbers_is_not_zero(text):
    points = np.array([[3e-200, 4e-200], [3.0, 4.0], [0.0, 0.0], [1e-160, 0.0], [3e-170, 4e-170]])
    far = np.array([5e-200, 5.0, 0.0, 1e-160, 5e-170])
    sign = -1 if ">" in text else 1
    spec = parse_spec(f"signal p[2]\nspec: {text}")
    together = spec.robustness({"p": points[:, None]})
    assert together == pytest.approx(sign * (1e-190 - far), rel=1e-15, abs=0)
    for point, value in zip(points, together, strict=True):
        assert spec.robustness({"p": point[None, None]}) == value
        assert spec.robustness_over_time({"p": point[None, None]}) == value
    assert parse_spec("x < norm((3e-200, 4e-200))").robustness({"x": [[0.0]]}) == pytest.approx(5e-200, abs=0)


def test_explaining_a_truncated_operand_takes_no_cubic_time():
    x = np.ones((1, 700))
    x[0, 600], y = 0.0, np.linspace(2, 0.5, 700)[None]
    start = time.process_time()
    (why,) = parse_spec("(F x < 0.5) U y < 1").explain({"x": x, "y": y})
    assert (why.predicate, why.step) == ("y < 1", 601)
    assert time.process_time() - start < 8


G, F, N, X, U, R, W, T = s.Always, s.Eventually, s.Not, s.Next, s.Until, s.Release, s.WeakUntil, s.Then


@settings(deadline=None, max_examples=60)
@given(formulas(2), formulas(2), batches(max_steps=6), st.integers(0, 3), st.integers(0, 3))
def test_dualities(p, q, batch, a, b):
    signals, lengths = batch
    w = s.Interval(s.Number(float(a)), s.Number(float(a + b)))
    for left, right in [
        (N(N(p)), p),
        (N(G(p)), F(N(p))),
        (N(G(p, w)), F(N(p), w)),
        (N(s.Next(p)), s.Next(N(p), True)),
        (N(U(p, q)), R(N(p), N(q))),
        (N(U(p, q, w)), R(N(p), N(q), w)),
        (N(s.And((p, q))), s.Or((N(p), N(q)))),
        (s.Implies(p, q), s.Or((N(p), q))),
        (W(p, q), s.Or((U(p, q), G(p)))),
        (F(G(p)), G(F(p))),
        (G(p), G(G(p))),
    ]:
        if not any(isinstance(node, s.ForEach) for f in (p, q) for node, _ in s.walk(f)):
            values = declared(left).robustness_over_time(signals, lengths)
            assert np.array_equal(values, declared(right).robustness_over_time(signals, lengths), equal_nan=True)


@settings(deadline=None, max_examples=100)
@given(comparisons, comparisons, comparisons, batches())
def test_then_of_state_formulas(a, b, c, batch):
    """What DESIGN says follows from the definition."""
    signals, lengths = batch

    def value(f):
        return declared(f).robustness(signals, lengths).tolist()

    assert value(T(a, b)) == value(F(s.And((a, s.Next(F(b), True)))))
    assert value(T(a, T(b, c))) == value(T(T(a, b), c))
    assert value(F(G(a))) == [
        robustness(a, {k: v[i] for k, v in signals.items()}, n - 1, n) for i, n in enumerate(lengths)
    ]


@pytest.mark.parametrize("steps", [1, 2, 3, 15, 16, 17, 63, 64, 65, 66, 130, 300])
@pytest.mark.parametrize("count", [1, 3, 40])
def test_long_trajectories(steps, count):
    """Sizes at which the evaluator takes its other ways: scans in blocks, windows narrow and wide."""
    generator = np.random.default_rng(steps)
    x, y = generator.normal(size=(2, count, steps))

    def value(text):
        return parse_spec(text).robustness_over_time({"x": x, "y": y})

    def fold(function, array, t, low, high):
        part = array[:, t + low : t + high + 1]
        return (
            getattr(part, function)(axis=1)
            if part.shape[1]
            else np.full(count, np.inf if function == "min" else -np.inf)
        )

    for low, high in [(0, 0), (0, 1), (0, 62), (0, 63), (0, 64), (2, 70), (5, 110), (0, 500), (400, 500)]:
        expected = [fold("max", x, t, low, high) for t in range(steps)]
        assert np.array_equal(value(f"F[{low}, {high}] x > 0"), np.array(expected).T)
        expected = [fold("min", x, t, low, high) for t in range(steps)]
        assert np.array_equal(value(f"G[{low}, {high}] x > 0"), np.array(expected).T)
    until, then = np.full((2, count, steps), -np.inf)
    after = np.full(count, -np.inf)
    best = np.full(count, -np.inf)
    both = np.full(count, -np.inf)
    for t in reversed(range(steps)):
        best = np.maximum(y[:, t], np.minimum(x[:, t], best))
        until[:, t] = best
        both = np.maximum(both, np.minimum(x[:, t], after))
        then[:, t] = both
        after = np.maximum(after, y[:, t])
    assert np.array_equal(value("(x > 0) U (y > 0)"), until)
    assert np.array_equal(value("(x > 0) T (y > 0)"), then)
    for text, expected in [("(x > 0) U (y > 0)", until), ("(x > 0) T (y > 0)", then)]:
        assert np.array_equal(parse_spec(text).robustness({"x": x, "y": y}), expected[:, 0])
    assert np.array_equal(value("G F x > 0"), np.repeat(x[:, -1:], steps, axis=1))


@pytest.mark.parametrize("steps", [1, 2, 17, 70])
@pytest.mark.parametrize("window", [(0, 0), (0, 1), (1, 1), (0, 2), (3, 9), (0, 62), (2, 70), (5, 110), (400, 500)])
def test_pairs_of_a_window(window, steps):
    x, y = np.random.default_rng(0).normal(size=(2, 3, steps))
    expected = np.full((3, steps), -np.inf)
    for t in range(steps):
        before = np.full(3, -np.inf)
        for k in range(t, min(t + window[1] + 1, steps)):
            if k >= t + window[0]:
                expected[:, t] = np.maximum(expected[:, t], np.minimum(before, y[:, k]))
            before = np.maximum(before, x[:, k])
    spec = parse_spec(f"(x > 0) T[{window[0]}, {window[1]}] (y > 0)")
    assert np.array_equal(spec.robustness_over_time({"x": x, "y": y}), expected)
    assert np.array_equal(spec.robustness({"x": x, "y": y}), expected[:, 0])


@pytest.mark.parametrize("narrow", [0, 4096])
def test_windows_by_blocks_and_by_doubling(narrow, monkeypatch):
    monkeypatch.setattr(scans, "_NARROW", narrow)
    x = np.random.default_rng(0).normal(size=(3, 40))
    for size in range(1, 41):
        views = np.lib.stride_tricks.sliding_window_view(x, size, axis=1)
        assert np.array_equal(scans.windows(np.minimum, x, size), views.min(axis=2))
        assert np.array_equal(scans.windows(np.maximum, x, size), views.max(axis=2))


@settings(deadline=None, max_examples=100)
@given(formulas(6), batches(max_count=1, max_steps=40))
def test_the_horizon_holds(f, batch):
    """Samples beyond the horizon change nothing, so long as they exist."""
    signals, _ = batch
    signals = {name: np.nan_to_num(values) for name, values in signals.items()}
    spec = declared(f)
    steps = signals["x"].shape[1]
    if spec.horizon is not None and spec.horizon + 1 < steps:
        other = {name: values.copy() for name, values in signals.items()}
        for name, values in other.items():
            values[:, spec.horizon + 1 :] = 1 - values[:, spec.horizon + 1 :] * (1 if name == "b" else 7)
        assert spec.robustness(signals) == spec.robustness(other)


@settings(deadline=None, max_examples=100)
@given(formulas(6), batches(max_count=1, max_steps=40))
def test_the_memory_holds(f, batch):
    """Samples before it change nothing."""
    signals, _ = batch
    signals = {name: np.nan_to_num(values) for name, values in signals.items()}
    spec = declared(f)
    steps = signals["x"].shape[1]
    if spec.memory is not None:
        other = {name: values.copy() for name, values in signals.items()}
        for name, values in other.items():
            values[:, : steps // 2] = 1 - values[:, : steps // 2] * (1 if name == "b" else 7)
        first = steps // 2 + spec.memory
        one, two = spec.robustness_over_time(signals), spec.robustness_over_time(other)
        assert one[0, first:].tolist() == two[0, first:].tolist()


@pytest.mark.parametrize(
    ("text", "memory", "horizon"),
    [
        ("x < 1", 0, 0),
        ("once x < 1", None, 0),
        ("once[2, 5] x < 1", 5, 0),
        ("once[2, inf] x < 1", None, 0),
        ("historically[0, 3] once[1, 2] x < 1", 5, 0),
        ("previous previous x < 1", 2, 0),
        ("x - previous(x) < 1", 1, 0),
        ("x > 0 since[1, 3] y > 0", 3, 0),
        ("previous x > 0 since[0, 3] y > 0", 3, 0),
        ("x > 0 since y > 0", None, 0),
        ("X previous x < 1", 0, 0),
        ("F[0, 3] previous x < 1", 1, 2),
        ("G[2, 4] once[0, 1] x < 1", 0, 4),
        ("G once x < 1", None, None),
    ],
)
def test_memory_and_horizon(text, memory, horizon):
    spec = parse_spec(text)
    assert (spec.memory, spec.horizon) == (memory, horizon)


short = st.tuples(st.integers(0, 2), st.integers(0, 2)).map(
    lambda ab: s.Interval(s.Number(float(ab[0])), s.Number(float(sum(ab))))
)


@st.composite
def read_once(draw, depth=3):
    """Bounded formulas in which each signal stands once: then each sample that the value is read from can change it."""
    names = (f"x{i}" for i in range(2**depth))

    def formula(depth):
        if depth == 0 or draw(st.booleans()):
            return s.Comparison((s.Name(next(names)), s.Number(0.0)), (">",))
        kind = draw(st.sampled_from([N, X, G, F, s.And, s.Or, s.Implies, U, R]))
        if kind is N or kind is X:
            return kind(formula(depth - 1))
        if kind is G or kind is F:
            return kind(formula(depth - 1), draw(short))
        if kind is s.And or kind is s.Or:
            return kind((formula(depth - 1), formula(depth - 1)))
        # On a slice cut short a temporal left operand may be decided by the cut, whatever the samples are.
        two = formula(0 if kind in (U, R) else depth - 1), formula(depth - 1)
        return kind(*two) if kind is s.Implies else kind(*two, draw(short))

    return formula(depth)


@settings(deadline=None, max_examples=200)
@given(read_once(), st.integers(0, 1000))
def test_the_horizon_is_reached_and_no_more(f, seed):
    """Samples beyond it never change the value; in some trajectory the sample at it does."""
    spec = parse_spec(str(f))
    generator = np.random.default_rng(seed)
    count, steps = 20_000, spec.horizon + 3

    def changed(columns):
        other = {name: values.copy() for name, values in signals.items()}
        for values in other.values():
            values[:, columns] = generator.normal(size=values[:, columns].shape)
        return spec.robustness(other) != spec.robustness(signals)

    # Of some signals almost all samples hold, of others almost none: what decides is often far away.
    likely = {name: generator.uniform(-3, 3, (count, 1)) for name in spec.signals}
    signals = {name: generator.normal(size=(count, steps)) + likely[name] for name in spec.signals}
    assert not changed(slice(spec.horizon + 1, None)).any()
    assert changed(slice(spec.horizon, spec.horizon + 1)).any()


@settings(deadline=None, max_examples=60)
@given(comparisons, batches())
def test_visit_once(g, batch):
    """`G (g => X G !g)` has a way of its own for the value at the first sample."""
    signals, lengths = batch
    spec = declared(G(s.Implies(g, s.Next(G(N(g))))))
    values = spec.robustness_over_time(signals, lengths)
    for row, length in enumerate(lengths):
        assert spec.robustness(cut(signals, row, length))[0] == values[row, 0]


def test_threads_do_not_share_working_arrays():
    spec = parse_spec("G (x > -1 => F x > 0) & (x > -1 U x > 1)")
    generator = np.random.default_rng(0)
    batches = [{"x": generator.normal(size=(20, 400))} for _ in range(40)]
    expected = [spec.robustness(batch).tolist() for batch in batches]
    with ThreadPoolExecutor(4) as pool:
        assert [values.tolist() for values in pool.map(spec.robustness, batches)] == expected
