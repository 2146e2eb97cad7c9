"""Functions of numbers, constants that are computed, and functions that a text defines."""

import math
import pickle

import numpy as np
import pytest
from oracle import number

from tltlrl.logic import SpecError, parse_spec

GENERATOR = np.random.default_rng(0)
X, Y = GENERATOR.uniform(-0.99, 0.99, (2, 1, 200))


@pytest.mark.parametrize(
    "text",
    [
        "tan(x)",
        "asin(x)",
        "acos(x)",
        "atan2(y, x)",
        "atan2(y, -1)",
        "log(abs(x))",
        "mod(x, 0.3)",
        "mod(x, -0.3)",
        "floor(5 * x)",
        "sign(x)",
        "clip(x, -0.5, 0.25)",
        "wrap(20 * x)",
        "min(x, y)",
        "exp(x)",
        "sin(x) + cos(y)",
        "sqrt(abs(x))",
    ],
)
def test_functions_of_numbers(text):
    spec = parse_spec(f"signal x signal y spec: {text} > 0")
    tree = spec._meaning.document.formula.operands[0]
    trace = {"x": X[0].tolist(), "y": Y[0].tolist()}
    expected = [number(tree, trace, t) for t in range(200)]
    assert spec.robustness_over_time({"x": X, "y": Y})[0].tolist() == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_an_angle_is_wrapped():
    angles = [math.pi, -math.pi, 3 * math.pi / 2, 0.1, -3, 2 * math.pi, math.nextafter(math.pi, 4)]
    wrapped = parse_spec("wrap(x) > 0").robustness_over_time({"x": [angles]})[0]
    assert wrapped.tolist()[3:5] == [0.1, -3]
    assert wrapped == pytest.approx([math.pi, math.pi, -math.pi / 2, 0.1, -3, 0, -math.pi], abs=1e-12)
    heading = parse_spec("G abs(wrap(heading - 3)) < 0.5").robustness({"heading": [[-3.1, 3.1, 2.9]]})
    assert heading == pytest.approx([0.5 - (2 * math.pi - 6.1)])


def test_pi_is_a_number_and_a_name_where_it_is_declared():
    assert parse_spec("x < pi").robustness({"x": [[0]]}) == [math.pi]
    assert parse_spec("signal pi spec: pi < 1").robustness({"pi": [[0]]}) == [1]


def test_a_product_of_vectors():
    assert parse_spec("dot(v, (1, 2)) < 10").robustness({"v": [[[3, 2]]]}) == [3]


@pytest.mark.parametrize(
    "word", ["rise", "sign", "clip", "once", "always", "next", "since", "true", "previous", "pi", "log"]
)
def test_words_of_the_second_edition_are_names_where_they_are_declared(word):
    text = f"signal {word} const a[{word}] = 1 def p[i in {word}, b]: {word} < 2 spec: F p[{word}] & {word} < a[{word}]"
    spec = parse_spec(text)
    assert spec.robustness({word: [[0.25]]}) == [0.75]
    assert parse_spec(str(spec)) == spec


COMPUTED = """
const width = 0.5
const half = width / 2
const corner[a, b] = ((half, 0), (-half, pi * 0))
const far = 2 * corner[a]
const settle = 3 * 0.5 s
signal ee[2]
spec: F distance(ee, far) < half
"""


def test_constants_are_computed():
    spec = parse_spec(COMPUTED)
    assert spec.constants["far"] == (0.5, 0.0)
    assert spec.constants["corner"] == {"a": (0.25, 0.0), "b": (-0.25, 0.0)}
    assert spec.durations == {"settle"}
    assert parse_spec(str(spec)) == spec
    assert pickle.loads(pickle.dumps(spec)) == spec
    assert "const far = (0.5, 0)" in str(spec)


def test_what_is_computed_from_an_overridden_constant_follows_it():
    assert parse_spec(COMPUTED, {"width": 2}).constants["far"] == (2.0, 0.0)
    assert parse_spec(COMPUTED, {"half": 1}).constants["far"] == (2.0, 0.0)
    spec = parse_spec(COMPUTED, {"corner": {"a": (3, 4)}})
    assert (spec.constants["far"], spec.constants["corner"]["b"]) == ((6.0, 8.0), (-0.25, 0.0))
    assert parse_spec(COMPUTED, {"far": (1, 1)}).constants["far"] == (1.0, 1.0)
    with pytest.raises(SpecError, match="the override of 'far' is 3; expected a vector of 2 numbers"):
        parse_spec(COMPUTED, {"far": 3})


NEAR = """
signal ee[2]
const goal[a, b] = ((1, 0), (0, 1))
let gap(p) = distance(ee, p)
def near(p, r): gap(p) < r
def soon(q, n): F[0, n] q
"""


def test_functions_of_the_text_are_what_they_say():
    ee = GENERATOR.normal(size=(20, 12, 2))
    for formula, plain in [
        ("F near(goal[a], 0.5)", "F distance(ee, (1, 0)) < 0.5"),
        ("all i in a, b: F near(goal[i], 0.5)", "F distance(ee, (1, 0)) < 0.5 & F distance(ee, (0, 1)) < 0.5"),
        ("G soon(near((0, 0), 1), 3)", "G F[0, 3] distance(ee, (0, 0)) < 1"),
        ("soon(!near((0, 0), 1), 2 * 2)", "F[0, 4] norm(ee) > 1"),
    ]:
        spec, other = parse_spec(f"{NEAR} spec: {formula}"), parse_spec(f"signal ee[2] spec: {plain}")
        assert spec.robustness({"ee": ee}) == pytest.approx(other.robustness({"ee": ee}))
        assert parse_spec(str(spec)) == spec


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("F at((1, 2)) & !at((0, 1)) U at((1, 2))", {"at((1, 2))": True, "at((0, 1))": False}),
        ("F holds(at((1, 2))) & G !holds(at((0, 1)))", {"at((1, 2))": True, "at((0, 1))": False}),
        ("G (holds(at((1, 2))) => p)", {"at((1, 2))": False}),
    ],
)
def test_regions_that_calls_and_conditions_speak_of_are_drawn(formula, expected):
    spec = parse_spec(f"signal ee[2]\nsignal p: bool\ndef at(c): distance(ee, c) < 0.3\nspec: {formula}")
    assert {region.name: region.inside for region in spec.regions} == expected


def test_explanations_and_regions_of_functions():
    spec = parse_spec(f"{NEAR} spec: all i in a, b: F near(goal[i], 0.5)")
    (why,) = spec.explain({"ee": np.array([[[1.0, 0.0], [0.5, 0.5]]])})
    assert (why.predicate, why.name) == ("gap(goal[b]) < 0.5", "near(goal[b], 0.5)")
    assert [(r.name, r.signal, r.centre) for r in parse_spec(f"{NEAR} spec: F ball(ee, goal[a], 1)").regions] == [
        (None, "ee", (1.0, 0.0))
    ]
    assert spec.definitions == {}


def test_functions_that_double_are_refused_in_time():
    text = "signal x def f0(a): x < a\n"
    text += "".join(f"def f{i + 1}(a): f{i}(a) & f{i}(a + {2**i})\n" for i in range(40))
    with pytest.raises(SpecError, match="is one of more than 1000 calls"):
        parse_spec(text + "spec: f40(1)")
    text = "signal x def f0(a): x < a\n" + "".join(f"def f{i + 1}(a): X f{i}(a)\n" for i in range(200))
    with pytest.raises(SpecError, match="nested more than 150 operators deep"):
        parse_spec(text + "spec: f200(1)")
    text = "signal x def f0(a): x < a\n" + "".join(f"def f{i + 1}(a): f{i}(a) & X f{i}(a)\n" for i in range(40))
    assert parse_spec(text + "spec: f40(1)").horizon == 40
