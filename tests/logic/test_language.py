"""Reading and writing specs: spellings, precedence, names, families, limits."""

import os
import pickle
import random
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from strategies import DECLARED, formulas

from tltlrl.logic import SpecError, is_signal_name, load_spec, parse_spec

ROOT = Path(__file__).parents[2]
SPECS = sorted((ROOT / "specs").glob("*.tltl"))


@settings(deadline=None, max_examples=300)
@given(formulas(8))
def test_the_text_of_a_formula_parses_back_to_it(f):
    spec = parse_spec(DECLARED + str(f))
    assert spec._meaning.document.formula == f
    assert parse_spec(str(spec)) == spec


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_the_text_of_a_spec_parses_back_to_it(path):
    spec = load_spec(path)
    again = parse_spec(str(spec))
    assert again == spec
    assert hash(again) == hash(spec)
    assert pickle.loads(pickle.dumps(spec)) == spec
    assert spec.text == path.read_text(encoding="utf-8")
    assert spec.path == path
    assert again.path is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("x < 1 & y < 1 && z < 1 and w < 1 ∧ v < 1", "x < 1 & y < 1 & z < 1 & w < 1 & v < 1"),
        ("x < 1 | y < 1 || z < 1 or w < 1 ∨ v < 1", "x < 1 | y < 1 | z < 1 | w < 1 | v < 1"),
        ("¬ x < 1 & not y < 1", "!(x < 1) & !(y < 1)"),
        ("x < 1 ⇒ y < 1", "x < 1 -> y < 1"),
        ("x < 1 → y < 1", "x < 1 => y < 1"),
        ("x < 1 ⇔ y < 1", "x < 1 <=> y < 1"),
        ("x < 1 ↔ y < 1", "x < 1 <-> y < 1"),
        ("□ ◊ x < 1", "G F x < 1"),
        ("◻ ◇ x < 1", "G F x < 1"),
        ("○ ◯[!] x ≤ 1 & x ≥ 0", "(X X[!] x <= 1) & x >= 0"),
        ("□[1, 2] x · y − 1 < 1", "G[1,2] ((x * y) - 1) < 1"),
        ("⋀ i in a, b: x < 1", "all i in a, b: x < 1"),
        ("⋁ i in a, b: x < 1", "any i in a, b: x < 1"),
        ("x < .5e1", "x < 5"),
        ("# comment\nx < 1 # another", "x < 1"),
        ("x <\r\n\t1", "x < 1"),
        # Precedence, loosest first: <=>, =>, |, &, U T R W, unary, comparison, + -, * /, unary -, **.
        ("x<1 <=> y<1 => z<1 | w<1 & v<1 U u<1", "x<1 <=> (y<1 => (z<1 | (w<1 & (v<1 U u<1))))"),
        ("G x<1 U !y<1", "(G (x<1)) U (!(y<1))"),
        ("x<1 U y<1 T z<1 R w<1 W v<1", "x<1 U (y<1 T (z<1 R (w<1 W v<1)))"),
        ("x<1 => y<1 => z<1", "x<1 => (y<1 => z<1)"),
        ("x<1 <=> y<1 <=> z<1", "x<1 <=> (y<1 <=> z<1)"),
        ("-x ** -2 ** y + z * w / 2 - 1 < 1", "(((-(x ** (-(2 ** y)))) + ((z * w) / 2)) - 1) < 1"),
        ("all i in a, b: x < 1 => y < 1", "all i in a, b: (x < 1 => y < 1)"),
    ],
)
def test_spellings_and_precedence(one, other):
    assert parse_spec(one) == parse_spec(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("(x<1 => y<1) => z<1", "x<1 => y<1 => z<1"),
        ("(x<1 U y<1) U z<1", "x<1 U y<1 U z<1"),
        ("(x - y) - z < 1", "x - (y - z) < 1"),
        ("X x < 1", "X[!] x < 1"),
    ],
)
def test_what_differs(one, other):
    assert parse_spec(one) != parse_spec(other)


def test_a_chain_is_the_conjunction_of_its_links():
    x = {"x": [[0.0, 0.5, 0.9, 2.0]]}
    assert parse_spec("0.25 < x <= 1").robustness_over_time(x) == pytest.approx(np.array([[-0.25, 0.25, 0.1, -1.0]]))
    assert np.array_equal(
        parse_spec("0.25 < x <= 1").robustness_over_time(x),
        parse_spec("0.25 < x & x <= 1").robustness_over_time(x),
    )


def test_arithmetic():
    text = """
    signal p[3]
    signal v
    const c[a] = (1, 2, 3)
    let d[i in a] = distance(p, c[i])
    let e = norm(p - c[a]) + abs(v) - sqrt(v * v) + exp(0) * sin(v) / 2 + cos(v) ** 2
    let f = max(p) - min(p.x, p[1], p.z) + norm(2 * p / 4) + min(-p)
    spec: d[a] + e + f > 0
    """
    generator = np.random.default_rng(1)
    p, v = generator.normal(size=(4, 5, 3)), generator.normal(size=(4, 5))
    far = np.linalg.norm(p - [1, 2, 3], axis=2)
    e = far + np.sin(v) / 2 + np.cos(v) ** 2
    f = p.max(axis=2) - p.min(axis=2) + np.linalg.norm(p / 2, axis=2) + (-p).min(axis=2)
    assert parse_spec(text).robustness_over_time({"p": p, "v": v}) == pytest.approx(far + e + f)


def test_whether_a_region_is_to_be_in_comes_from_the_formula():
    spec = parse_spec(
        "signal ee[2]\nconst o = (0, 0)\n"
        "def in_rock: distance(ee, o) < 0.4\ndef walls: box(ee, o, (1, 1))\ndef far: distance(ee, o) > 2\n"
        "def goal: ball(ee, (1, 1), 0.2)\ndef free: distance(ee, o) > 0.1\n"
        "spec: G !in_rock & !(F walls) & G !far & (!goal U in_rock => F goal) & G !(free => F !ball(ee, (4, 4), 1))"
    )
    inside = {region.name: region.inside for region in spec.regions}
    assert inside == {"in_rock": False, "walls": False, "far": True, "goal": True, "free": False, None: True}
    assert not parse_spec("signal ee[2]\nspec: G !ball(ee, (0, 0), 1) U ee.x > 1").regions[0].inside


def test_regions():
    spec = parse_spec(
        "signal ee[2]\nsignal q[2]\nconst c[a] = (1, 2)\nconst c[b] = (3, 4)\nconst r = 0.5\n"
        "let d[i in a, b] = distance(ee, c[i])\n"
        "def at[i in a, b]: d[i] < r\n"
        "spec: F at[a] & G at[b] & box(2 * q, (0, 0), (1, 2)) & !ball(q, c[a], r)"
    )
    x = np.array([[[1.0, 2.25]]])
    assert spec.robustness({"ee": x, "q": x}) == [-2.5]
    assert [(r.name, r.kind, r.signal, r.centre, r.radius, r.lower, r.upper) for r in spec.regions] == [
        ("at[a]", "ball", "ee", (1.0, 2.0), 0.5, None, None),
        ("at[b]", "ball", "ee", (3.0, 4.0), 0.5, None, None),
        (None, "box", None, None, None, (0.0, 0.0), (1.0, 2.0)),
        (None, "ball", "q", (1.0, 2.0), 0.5, None, None),
    ]
    ball, box = parse_spec("ball(x, (0, 0), 2)"), parse_spec("box(x, (0, 0), (4, 1))")
    assert ball.robustness({"x": [[[3, 4]]]}) == [-3]
    assert box.robustness({"x": [[[3, 0.25]], [[1, 3]]]}).tolist() == [0.25, -2]


def test_a_distance_beyond_a_negative_number_is_no_region():
    assert parse_spec("distance(p, (0, 0)) > -1").regions == ()


def test_constants_are_overridden():
    text = "const goal[r] = (1, 2)\nconst goal[g] = (3, 4)\nconst s = 5\nsignal x\nspec: G[0, s] x < s"
    spec = parse_spec(text, {"goal": {"r": np.array([7, 8])}, "s": 2})
    assert spec.constants == {"goal": {"r": (7.0, 8.0), "g": (3.0, 4.0)}, "s": 2.0}
    assert spec.horizon == 2
    assert parse_spec(text).horizon == 5
    assert spec != parse_spec(text)
    assert parse_spec(str(spec)) == spec == pickle.loads(pickle.dumps(spec))


@pytest.mark.parametrize(
    ("text", "horizon"),
    [
        ("x > 0 U[0,2] y > 0", 2),
        ("x > 0 R[0,2] y > 0", 2),
        ("X (x > 0 U[1,3] y > 0)", 4),
        ("F[0,3] (x > 0 U[0,2] y > 0)", 5),
        ("x < 1", 0),
        ("X X x < 1", 2),
        ("G[2,5] F[0,3] x < 1", 8),
        ("(X y < 1) U[1,4] x < 1", 4),
        ("F x < 1", None),
    ],
)
def test_horizon(text, horizon):
    assert parse_spec(text).horizon == horizon


@pytest.mark.parametrize(
    ("text", "signals"),
    [
        ("F distance(ee, (1, 2)) < 0.2 & norm(ee - q) > 1 & x < 1", {"ee": 2, "q": 2, "x": None}),
        ("norm(c - (0, 0)) < 1 & norm(b - c) < 1 & norm(a - b) < 1", {"a": 2, "b": 2, "c": 2}),
        ("norm(a - b) < 1 & norm(b - c) < 1 & norm(c - (0, 0)) < 1", {"a": 2, "b": 2, "c": 2}),
        ("distance(2 * ee, (1, 2)) < 1", {"ee": 2}),
        ("norm(-ee + (1, 2)) < 1", {"ee": 2}),
        ("distance(ee / 2 * 3 - q, (1, 2, 3)) < 1", {"ee": 3, "q": 3}),
        ("box(ee, a, (1, 2)) & ball(q, a, 0.5)", {"ee": 2, "a": 2, "q": 2}),
        ("dot(a, b) < 1 & norm(b - (1, 2)) < pi", {"a": 2, "b": 2}),
        ("norm(v - previous(v)) < 1 & norm(v + (1, 2)) < 1", {"v": 2}),
        ("distance(x, y) < 1", {"x": None, "y": None}),
    ],
)
def test_signals_of_a_bare_formula(text, signals):
    assert parse_spec(text).signals == signals


def test_many_signals_of_one_dimension_are_found_out_at_once():
    links = [f"norm(a{i} - a{i + 1}) < 1" for i in range(400)]
    random.Random(0).shuffle(links)
    start = time.process_time()
    spec = parse_spec(" & ".join([*links, "norm(a400 - (0, 0)) < 1"]))
    assert set(spec.signals.values()) == {2}
    assert time.process_time() - start < 5


def test_definitions_in_order_even_when_used_before():
    spec = parse_spec("signal x\ndef late: F early[a]\ndef early[i in a, b]: x < 1\nspec: late")
    assert list(spec.definitions.items()) == [
        ("late", "F early[a]"),
        ("early[a]", "x < 1"),
        ("early[b]", "x < 1"),
    ]


def test_the_paths_and_the_facts_of_the_case_study():
    reach, visit, toast = (load_spec(ROOT / "specs" / f"{n}.tltl") for n in ("reach_avoid", "visit_in_order", "toast"))
    assert list(reach.constants) == ["goal", "goal_radius", "obstacle", "obstacle_radius"]
    assert list(visit.constants["obstacle"]) == ["1", "2", "3"]
    assert toast.signals == {"ee": 3, "rotation": 3, "gripper": None}
    assert all(spec.horizon is None for spec in (reach, visit, toast))
    # The best possible toast trajectory of the predicates: every margin saturates at half of the slot's width.
    ee = np.tile([0.7, -0.35, 0.05], (1, 100, 1))
    ee[0, :50] = [0.7, -0.6, 0.1]
    gripper = np.where(np.arange(100) > 49.5, 100.0, 0.0)[None]
    value = toast.robustness({"ee": ee, "rotation": 0 * ee, "gripper": gripper})
    assert value == pytest.approx([0.025])
    # eq. 3.8 prints a max where !(table | toaster) has a min: through the toaster it must be violated.
    assert toast.robustness({"ee": ee - [0, 0, 0.1], "rotation": 0 * ee, "gripper": gripper}) < -0.03


def test_the_goal_region_is_occupied_for_one_sample_only():
    """G (g => X G !g): at most half of the largest step of the end-effector."""
    spec = parse_spec("G (ball(ee, (0, 0), 0.5) => X G !ball(ee, (0, 0), 0.5)) & F ball(ee, (0, 0), 0.5)")
    generator = np.random.default_rng(0)
    ee = np.cumsum(generator.normal(size=(200, 60, 2)) * 0.2, axis=1)
    steps = np.linalg.norm(np.diff(ee, axis=1), axis=2).max(axis=1)
    assert (spec.robustness({"ee": ee}) <= steps / 2).all()


@pytest.mark.parametrize("deep", ["!" * 10_000 + "x < 1", "x < 1 => " * 10_000 + "x < 1", "-" * 10_000 + "x < 1"])
def test_deep_nesting_is_refused(deep):
    with pytest.raises(SpecError, match="nested more than 100 operators deep; expected less; name parts"):
        parse_spec(deep)


def test_100_operators_may_nest():
    assert parse_spec("!" * 99 + "x < 1").robustness({"x": [[0.0]]}) == [-1]
    with pytest.raises(SpecError, match="more than 100 operators"):
        parse_spec("!" * 100 + "x < 1")


def test_what_is_long_but_not_deep_is_read():
    assert parse_spec("(" * 10_000 + "x < 1" + ")" * 10_000) == parse_spec("x < 1")
    many = parse_spec(" & ".join(f"x < {k}" for k in range(3_000)))
    assert many.robustness({"x": [[0.5]]}) == [-0.5]
    chain = "signal x\ndef p0: x < 1\n" + "".join(f"def p{k}: !p{k - 1} | p{k - 1}\n" for k in range(1, 3_001))
    deep = parse_spec(chain + "spec: p3000")
    assert deep.robustness({"x": [[0.5]]}) == [0.5]
    assert deep.explain({"x": [[0.5]]})[0].margin == 0.5


def test_a_formula_that_uses_another_twice_at_each_level_is_read_at_once():
    chain = "signal x\ndef p0: x < 1\n" + "".join(f"def p{k}: p{k - 1} & p{k - 1}\n" for k in range(1, 61))
    assert parse_spec(chain + "spec: G p60").robustness({"x": [[0.5]]}) == [0.5]


def test_quantifiers_that_nest_write_out_so_much_and_no_more():
    def nested(count):
        return "".join(f"all v{k} in a, b: " for k in range(count)) + "x < 1"

    assert parse_spec(nested(10)).robustness({"x": [[0.0]]}) == [1]
    start = time.process_time()
    for count in (16, 40, 90):
        with pytest.raises(SpecError, match=r"with its quantifiers written out this holds .* expected at most 200000"):
            parse_spec(nested(count))
    family = "signal x\ndef p[i in a, b]: " + nested(15) + "\nspec: p[a]"
    with pytest.raises(SpecError, match="quantifiers written out"):
        parse_spec(family)
    # The advice: a definition is read once.
    chain = "signal x\ndef p0: x < 1\n" + "".join(f"def p{k}: all v in a, b: p{k - 1}\n" for k in range(1, 41))
    assert parse_spec(chain + "spec: p40").robustness({"x": [[0.0]]}) == [1]
    assert time.process_time() - start < 10


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_comment_ends_with_its_line(end):
    lines = ["# a comment", "signal x # m", "const c = 1 # m", "spec: x < c # all"]
    assert parse_spec(end.join(lines)).robustness({"x": [[0.0]]}) == [1]
    with pytest.raises(SpecError, match=r"<spec>:3:9: unknown name 'y'"):
        parse_spec(end.join(["# one", "signal x", "spec: G y < 1"]))


def test_a_mistake_after_much_space_is_told_at_once():
    start = time.process_time()
    for filler in (" ", "# a comment\n", "x"):
        with pytest.raises(SpecError):
            parse_spec("x < 1 &" + filler * 50_000 + ")")
    assert time.process_time() - start < 5


def test_what_rounding_leaves_of_a_bound_is_rounded():
    text = "const dt = 0.1\nconst deadline = 0.7\nsignal x\nspec: F[0, deadline / dt] x > 0"
    assert parse_spec(text).horizon == 7
    for bound, horizon in [("0.3 / 0.1", 3), ("0.29 * 100", 29), ("1 + (0.3 - 3 * 0.1)", 1)]:
        assert parse_spec(f"F[0, {bound}] x > 0").horizon == horizon
    for bound in ("6.5", "7.00001", "7.0000001"):
        with pytest.raises(SpecError, match=f"the bound is {bound}; expected a whole number"):
            parse_spec(f"F[0, {bound}] x > 0")


def test_two_different_untils_are_shown_with_parentheses():
    spec = parse_spec("a > 0 U b > 0 W c > 0")
    assert spec.robustness({"a": [[1, -1]], "b": [[-1, -1]], "c": [[-1, 1]]}) == [1]
    assert spec.formula == "a > 0 U (b > 0 W c > 0)"
    assert parse_spec("a > 0 T b > 0 T c > 0").formula == "a > 0 T b > 0 T c > 0"
    assert parse_spec("a > 0 T (b > 0 U[1,2] c > 0)").formula == "a > 0 T (b > 0 U[1, 2] c > 0)"


def test_bounds_are_sums_of_constants():
    spec = parse_spec("const n = 5\nsignal x\nspec: G[n-2, 2*n - 1] x < 1")
    assert spec == parse_spec("const n = 5\nsignal x\nspec: G[(n-2), ((2*n) - 1)] x < 1") == parse_spec(str(spec))
    assert spec.horizon == 9


def test_import_is_light():
    """The language alone: no simulator, no config system, no plots."""
    code = "import sys, tltlrl.logic; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert not {"mujoco", "dm_control", "hydra", "matplotlib", "pandas", "scipy"} & set(loaded.stdout.split())


WORDS = [
    *[
        "signal",
        "const",
        "let",
        "def",
        "spec",
        "in",
        "all",
        "any",
        "and",
        "or",
        "not",
        "U",
        "R",
        "W",
        "T",
        "X",
        "X[!]",
        "G",
        "F",
        "true",
    ],
    *[
        "x",
        "y",
        "ee",
        "goal",
        "r",
        "g",
        "0",
        "1",
        "2.5",
        "1e9",
        "1e400",
        "(",
        ")",
        "[",
        "]",
        ",",
        ":",
        ".",
        "=",
        "<",
        "<=",
        ">",
        ">=",
        "+",
        "-",
        "*",
        "/",
        "**",
        "&",
        "|",
        "!",
        "=>",
        "<=>",
        "#",
        "∧",
        "□",
        "○[!]",
        "⋀",
        "\n",
    ],
    *["norm(", "distance(", "ball(", "box(", "min(", "abs(", "G[0,3]", "U[2,1]", "ee.x", "goal[r]"],
    *["~", "@", "\x00", "é", "𝔸", "²", "\t", "\ufeff", "\u2028"],
]


def mutant(generator, texts):
    """A spec with some of its words swapped, dropped, doubled or replaced, and sometimes cut."""
    words = re.findall(r"\w+|\s+|\S", generator.choice(texts))
    for _ in range(generator.randint(1, 4)):
        at = generator.randrange(len(words) + 1)
        match generator.randrange(5):
            case 0:
                words[at : at + generator.randint(1, 3)] = []
            case 1:
                words[at:at] = [generator.choice(WORDS)]
            case 2:
                words[at : at + 1] = [generator.choice(WORDS)]
            case 3:
                words[at:at] = words[at : at + generator.randint(1, 8)] * generator.randint(1, 3)
            case _:
                other = generator.randrange(len(words) + 1)
                words[at : at + 1], words[other : other + 1] = words[other : other + 1], words[at : at + 1]
    return "".join(words[: generator.randrange(len(words) + 1)] if generator.random() < 0.05 else words)


def test_fuzz():
    """Mutated specs give a SpecError or a spec: nothing else, and quickly. TLTL_FUZZ sets how many (2000)."""
    texts = [path.read_text(encoding="utf-8") for path in SPECS]
    texts += ["F G (x < 0.2)", "G[0,5] (x < 1 => F[1,3] y > 2)", "(a < 1) U[2,4] (b > 1) T (c < 2)"] * 2
    page = (ROOT / "docs" / "spec-examples.md").read_text(encoding="utf-8")
    texts += re.findall(r"^```tltl\n(.*?)^```", page, flags=re.M | re.S)
    texts += [re.sub(r"#.*\n", "\n", text) for text in texts]
    generator = random.Random(int(os.environ.get("TLTL_FUZZ_SEED", "0")))
    read = 0
    for _ in range(int(os.environ.get("TLTL_FUZZ", "2000"))):
        text = mutant(generator, texts)
        start = time.process_time()
        try:
            spec = parse_spec(text)
        except SpecError as error:
            spec, told = None, str(error)
        if spec is None:
            assert re.match(r"<spec>:\d+:\d+: ", told), text
        else:
            read += 1
            assert parse_spec(str(spec)) == spec
        assert time.process_time() - start < 10, text
    assert read > 0


@pytest.mark.parametrize("name", ["x", "ee", "_", "F_", "größe"])
def test_a_word_that_means_nothing_else_names_a_signal(name):
    assert is_signal_name(name)
    assert set(parse_spec(f"signal {name} spec: {name} > 0").signals) == {name}


@pytest.mark.parametrize("name", ["", "F", "ball", "max", "a b", "a.b", "x\nsignal y", "x[2]", "1x"])
def test_what_means_something_or_is_no_word_does_not(name):
    assert not is_signal_name(name)
