"""A monitor's readings against whole evaluations of every prefix."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from strategies import SIGNALS, formulas

from tltlrl.logic import SpecError, TraceError, load_spec, parse_spec
from tltlrl.logic.online import automaton, together

SPECS = sorted((Path(__file__).parents[3] / "specs").glob("*.tltl"))
NAMES = (*SIGNALS, "w", "b")
DECLARED = "signal b: bool\n" + "".join(f"signal {name}\n" for name in NAMES[:-1]) + "spec: "
seeds = st.integers(0, 2**32 - 1)


def samples(seed, count=3, steps=8):
    generator = np.random.default_rng(seed)
    signals = {name: generator.integers(-12, 13, (count, steps)) / 4 for name in NAMES}
    return signals | {"b": generator.integers(0, 2, (count, steps)).astype(float)}


def readings(monitor, signals):
    steps = next(iter(signals.values())).shape[1]
    return [monitor.update({name: values[:, t] for name, values in signals.items()}) for t in range(steps)]


def check(spec, signals, every=1):
    """Every promise of a reading, at every prefix; the monitor."""
    monitor = spec.monitor(len(next(iter(signals.values()))))
    found = readings(monitor, signals)
    for t in range(0, len(found), every):
        reading = found[t]
        prefix = {name: values[:, : t + 1] for name, values in signals.items()}
        np.testing.assert_array_equal(reading.robustness, spec.robustness(prefix))
        np.testing.assert_array_equal(reading.decided, reading.lower == reading.upper)
        for later in found[t:]:
            assert (reading.lower <= later.robustness).all()
            assert (later.robustness <= reading.upper).all()
            assert (reading.lower <= later.lower).all()
            assert (later.upper <= reading.upper).all()
    return monitor


@given(formulas(), seeds)
@settings(deadline=None, max_examples=60)
def test_every_prefix_has_the_robustness_of_a_whole_evaluation(formula, seed):
    check(parse_spec(DECLARED + str(formula)), samples(seed))


@pytest.mark.parametrize("most", [2, 4])
@given(formulas(), seeds)
@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_where_automata_grow_too_large_the_slow_ways_are_as_exact(monkeypatch, most, formula, seed):
    monkeypatch.setattr(automaton, "MOST_STATES", most)
    check(parse_spec(DECLARED + str(formula)), samples(seed))


@pytest.mark.parametrize("operator", ["once", "historically"])
def test_a_window_of_the_past_that_has_not_begun_yet_is_empty(operator):
    for low in range(7):
        for high in range(low, 8):
            check(parse_spec(f"{DECLARED}G ({operator}[{low}, {high}] x < 0 | y > 1)"), samples(high))


@pytest.mark.parametrize(
    "formula", ["G (x > 0 => F (y > 0 & X G z > 0))", "F (x > 0 & G[0,3] y > 0) & G (z > 0 => F x > 1)"]
)
def test_an_automaton_that_takes_too_many_comparisons_is_given_up(monkeypatch, formula):
    spec = parse_spec(DECLARED + formula)
    assert not check(spec, samples(0)).keeps_past
    monkeypatch.setattr(automaton, "MOST_COMPARISONS", 50)
    assert check(parse_spec(DECLARED + formula), samples(0)).keeps_past


@pytest.mark.parametrize(
    "formula",
    [
        "(b since[4, inf] x > z <=> abs(x) < w) R[2, 8] (historically[4, 5] x < 0 <=> y < w U[4, 5] x > 1)",
        "(x > y U[1, 5] z > w) R[2, 4] (x > 0 U[1, 1?] 1.75 <= previous(abs(z)) < w xor y > 0 | 1.75 <= abs(y) < w)",
    ],
)
def test_formulas_whose_automata_would_take_up_to_minutes_to_make(formula):
    check(parse_spec(DECLARED + formula), samples(0))


@given(formulas(), seeds)
@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_groups_of_very_different_sizes_are_folded_one_after_the_other(monkeypatch, formula, seed):
    monkeypatch.setattr(together, "_MOST_FILLING", 0)
    check(parse_spec(DECLARED + str(formula)), samples(seed))


@pytest.mark.parametrize("text", ["G (norm(p) < 1)", "F (exp(p.x * 1e203) < 1)", "G (p.x * p.x >= 0)"])
def test_numbers_too_small_for_a_float_are_as_in_a_whole_evaluation(text):
    spec, p = parse_spec(f"signal p[2]\nspec: {text}"), np.array([[[-1e-200, 2e-200], [-3e-200, 1e-200]]])
    found = [spec.monitor().update({"p": p[:, 0]}).robustness[0], readings(spec.monitor(), {"p": p})[-1].robustness[0]]
    assert found == [spec.robustness({"p": p[:, :1]})[0], spec.robustness({"p": p})[0]]


@given(formulas(), seeds, st.integers(0, 7))
@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_trajectories_that_are_kept_go_on_as_if_alone(monkeypatch, formula, seed, left):
    """Half of them with automata of at most 4 states, so that queues and whole pasts are cut, too."""
    monkeypatch.setattr(automaton, "MOST_STATES", 4 if seed % 2 else 200)
    spec, signals, rows = parse_spec(DECLARED + str(formula)), samples(seed, 4), np.array([3, 1])
    few = {name: values[rows] for name, values in signals.items()}
    monitor = spec.monitor(4)
    readings(monitor, {name: values[:, :left] for name, values in signals.items()})
    monitor.keep(rows)
    later = readings(monitor, {name: values[:, left:] for name, values in few.items()})
    for reading, alone in zip(later, readings(spec.monitor(2), few)[left:], strict=True):
        for part, own in zip(reading, alone, strict=True):
            np.testing.assert_array_equal(part, own)


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_the_specs_of_the_repository(path):
    spec, generator = load_spec(path), np.random.default_rng(0)
    shapes = {name: () if d is None else (d,) for name, d in spec.signals.items()}
    signals = {name: np.cumsum(generator.normal(size=(5, 110, *own)) * 0.2, axis=1) for name, own in shapes.items()}
    monitor = check(spec, signals, every=10)
    assert not monitor.keeps_past


@pytest.mark.parametrize(
    ("formula", "numbers"),
    [
        ("F[0,1000] (x > 2)", 3),
        ("G[2,1000] (x < 2)", 3),
        ("(x < 1) U[3,1000] (y > 1)", 9),
        ("X[!] G[700,1000] (x < 2)", 5),
    ],
)
def test_a_long_window_from_the_start_is_a_clock(formula, numbers):
    spec = parse_spec(DECLARED + formula)
    check(spec, samples(0, 2, 40))
    assert spec.monitor().update(dict.fromkeys(NAMES, 0.0)).state.shape == (1, numbers)


@pytest.mark.parametrize("formula", ["G (x > 0 => F[0,250] (y > 2))", "G ((x > 2) | (z < 1) U[3,300] (y > 2))"])
def test_a_long_window_inside_an_unbounded_operator_is_a_queue(formula):
    monitor = check(parse_spec(DECLARED + formula), samples(0, 2, 400), every=29)
    assert not monitor.keeps_past


def test_only_an_unbounded_formula_in_a_long_window_in_an_unbounded_operator_keeps_the_past():
    monitor = check(parse_spec(DECLARED + "G (x > 2 => F[0,300] G (y < 3))"), samples(0, 2, 30))
    assert monitor.keeps_past
    assert monitor.update(dict.fromkeys(NAMES, (0.0, 0.0))).state is None


def test_the_past_of_the_future_is_read_whole_and_has_no_bounds():
    monitor = check(parse_spec(DECLARED + "G once (F[0,2] (x > 0)) & G (y > -9)"), samples(0, 2, 12))
    assert monitor.keeps_past
    reading = monitor.update(dict.fromkeys(NAMES, (0.0, 0.0)))
    assert (reading.lower == -np.inf).all()
    assert np.isfinite(reading.upper).all()  # of the other conjunct


@pytest.mark.parametrize(
    ("formula", "numbers"),
    [
        ("G (x > 0 => once[2,5] (y > 1))", 2 + 5),
        ("F ((x < 2) since (y > 1))", 2 + 1),
        ("G (x - previous(x) < 5)", 2 + 1),
    ],
)
def test_operators_of_the_past_keep_what_they_ask_for_again(formula, numbers):
    monitor = check(parse_spec(DECLARED + formula), samples(0, 2, 30))
    assert monitor.update(dict.fromkeys(NAMES, (0.0, 0.0))).state.shape == (2, numbers)


def test_upper_falls_below_zero_at_the_step_that_breaks_an_always():
    monitor = parse_spec("F (x > 5) & G (x > 0)").monitor()
    found = [monitor.update({"x": x}) for x in (1.0, 0.5, -0.25, 9.0)]
    assert [float(r.upper[0]) for r in found] == [1.0, 0.5, -0.25, -0.25]
    assert [float(r.robustness[0]) for r in found] == [-4.0, -4.0, -4.0, -0.25]
    assert [float(r.lower[0]) for r in found] == [-np.inf] * 4


def test_a_bounded_formula_is_decided_when_its_window_is_past():
    monitor = parse_spec("F[1,2] (x > 0)").monitor()
    found = [monitor.update({"x": x}) for x in (5.0, -3.0, -1.0, 7.0)]
    assert [(float(r.lower[0]), float(r.upper[0])) for r in found] == [
        (-np.inf, np.inf),
        (-3.0, np.inf),
        (-1.0, -1.0),
        (-1.0, -1.0),
    ]
    assert [bool(r.decided[0]) for r in found] == [False, False, True, True]


@given(formulas(), seeds)
@settings(deadline=None, max_examples=30)
def test_equal_states_have_equal_futures(formula, seed):
    """A state that comes again, in another trajectory, at another time if no clock counts, leads to the same values."""
    spec, signals = parse_spec(DECLARED + str(formula)), samples(seed, 40, 3)
    monitor = spec.monitor(40)
    state = readings(monitor, signals)[-1].state
    if state is None:
        return
    one_future = {name: np.repeat(values[:1], 40, axis=0) for name, values in samples(seed + 1, 1, 4).items()}
    later = readings(monitor, one_future)
    _, index = np.unique(state, axis=0, return_inverse=True)
    for reading in later:
        for group in range(index.max() + 1):
            own = index.reshape(-1) == group
            assert len(np.unique(reading.robustness[own])) == 1
            assert len(np.unique(reading.upper[own])) == 1


def test_many_trajectories_are_read_as_each_alone():
    spec, signals = load_spec(SPECS[-1]), {"ee": np.random.default_rng(0).normal(size=(4, 9, 2))}
    together = readings(spec.monitor(4), signals)
    for row in range(4):
        for whole, own in zip(together, readings(spec.monitor(), {"ee": signals["ee"][row : row + 1]}), strict=True):
            for a, b in zip(whole, own, strict=True):
                np.testing.assert_array_equal(a[row], b[0])


def test_after_a_restart_other_trajectories_begin():
    monitor = parse_spec("G (x > 0) & F[2,3] (x > 1)").monitor(2)
    first = readings(monitor, {"x": np.array([[1.0, 2, 3], [4, 5, 6]])})
    readings(monitor, {"x": np.array([[-9.0], [-9]])})
    monitor.restart()
    again = readings(monitor, {"x": np.array([[1.0, 2, 3], [4, 5, 6]])})
    for before, after in zip(first, again, strict=True):
        for a, b in zip(before, after, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_bad_sample_is_told_with_its_step_and_counts_as_not_read():
    monitor = parse_spec("G (1 / x > 0)").monitor()
    monitor.update({"x": 4.0})
    for value, problem in ((0.0, "trajectory 0, step 1: division by zero"), (np.nan, "is nan at trajectory 0, step 1")):
        with pytest.raises(TraceError, match=problem):
            monitor.update({"x": value})
    assert monitor.update({"x": 2.0}).robustness == [0.25]
    assert monitor.steps == 2


@pytest.mark.parametrize(
    ("signals", "problem"),
    [
        ({"y": 1.0}, "no signal 'ee'"),
        ({"ee": [1.0, 2.0, 3.0]}, r"signal 'ee' has shape \(3,\); expected \(1, 2\), a sample of each trajectory"),
        ({"ee": "here"}, r"signal 'ee' has shape \(\); expected \(1, 2\)"),
        ({"ee": ["a", "b"]}, "no array of numbers"),
    ],
)
def test_what_is_no_sample_is_told(signals, problem):
    with pytest.raises(TraceError, match=problem):
        parse_spec("signal ee[2]\nspec: G (ee.x > 0)").monitor().update(signals)


def test_seconds_need_a_period():
    spec = parse_spec("F[0 s, 1 s] (x > 0)")
    with pytest.raises(SpecError, match="how far apart samples are is not known"):
        spec.monitor()
    monitor = spec.monitor(period=0.5)
    assert [bool(monitor.update({"x": -1.0}).decided[0]) for _ in range(4)] == [False, False, True, True]


def test_a_formula_that_nests_too_deep_is_told():
    text = "signal x\n" + "def p0: x > 0\n" + "".join(f"def p{i + 1}: X F p{i}\n" for i in range(900)) + "spec: p900"
    with pytest.raises(SpecError, match="nests too deep to be monitored"):
        parse_spec(text).monitor()


def test_there_is_at_least_one_trajectory():
    with pytest.raises(ValueError, match="count is 0; expected 1 or more"):
        parse_spec("G (x > 0)").monitor(0)


def test_floats_and_what_has_to_be_made_floats_are_read_alike():
    """The first take a shorter way."""
    spec = parse_spec("signal p[2]\nsignal b: bool\nspec: G (b | once (p.y > 0)) & F (norm(p) > 1)")
    signals = {"p": np.random.default_rng(0).normal(size=(3, 9, 2)), "b": np.eye(3, 9)}
    plain = readings(spec.monitor(3), signals)
    monitor = spec.monitor(3)
    for t, reading in enumerate(plain):
        other = monitor.update({name: values[:, t].tolist() for name, values in signals.items()})
        for a, b in zip(reading, other, strict=True):
            np.testing.assert_array_equal(a, b)
    for name, bad in (
        ("p", np.full((3, 2), np.inf)),
        ("b", np.full(3, 0.5)),
        ("b", np.ma.masked_equal(np.eye(3)[0], 1)),
    ):
        sample = {key: values[:, 0] for key, values in signals.items()} | {name: bad}
        with pytest.raises(TraceError, match=f"signal '{name}'"):
            monitor.update(sample)
