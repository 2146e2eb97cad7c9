"""Many of a kind: families of signals, ranges of labels, tables of constants, balls and boxes around signals."""

import numpy as np
import pytest

from tltlrl.logic import TraceError, parse_spec
from tltlrl.logic.trace import columns, read_recording

GENERATOR = np.random.default_rng(0)
EE, PED = GENERATOR.normal(size=(4, 9, 2)), GENERATOR.normal(size=(3, 4, 9, 2))
SIGNALS = {"ee": EE, **{f"ped[{i + 1}]": values for i, values in enumerate(PED)}}


def test_a_family_of_signals():
    spec = parse_spec("signal ee[2] signal ped[i in 1..3][2] spec: all i in 1..3: G distance(ee, ped[i]) > 0.5")
    assert spec.signals == {"ee": 2, "ped[1]": 2, "ped[2]": 2, "ped[3]": 2}
    nearest = np.linalg.norm(EE - PED, axis=-1).min(axis=(0, 2))
    assert spec.robustness(SIGNALS) == pytest.approx(nearest - 0.5)
    assert parse_spec(str(spec)) == spec
    with pytest.raises(TraceError, match=r"the trajectories have no signal 'ped\[3\]'"):
        spec.robustness({name: values for name, values in SIGNALS.items() if name != "ped[3]"})
    with pytest.raises(TraceError, match=r"<spec>:1:21: signal 'ped\[1\]' has shape"):
        spec.robustness(SIGNALS | {"ped[1]": PED[0][..., 0]})


def test_a_family_of_truths():
    spec = parse_spec("signal x signal open[i in a, b]: bool spec: G (any i in a, b: open[i] & x < 1)")
    signals = {"x": [[0, 0.5]], "open[a]": [[True, False]], "open[b]": [[False, True]]}
    assert spec.robustness(signals) == [0.5]
    assert spec.booleans == {"open[a]", "open[b]"}


def test_columns_of_a_family(tmp_path):
    (tmp_path / "trace.csv").write_text("ped[1].x,ped[1].y,ped[2].x,ped[2].y\n1,2,3,4\n")
    spec = parse_spec("signal ped[i in 1..2][2] spec: distance(ped[1], ped[2]) < 3")
    signals = read_recording(tmp_path / "trace.csv").signals(spec.signals)
    assert {name: values.tolist() for name, values in signals.items()} == {"ped[1]": [[[1, 2]]], "ped[2]": [[[3, 4]]]}
    assert columns("ped[1]", 2) == ["ped[1].x", "ped[1].y"]


@pytest.mark.parametrize(
    ("short", "long"),
    [
        (
            "const o[1..3] = ((0.3, 2), (-0.6, 0.6), (1, 1))",
            "const o[1] = (0.3, 2) const o[2] = (-0.6, 0.6) const o[3] = (1, 1)",
        ),
        ("const o[r, g] = ((0, 1), (1, 0))", "const o[r] = (0, 1) const o[g] = (1, 0)"),
        ("const o[r, 1..2] = ((0, 1), (1, 0), (2, 2))", "const o[r] = (0, 1) const o[1] = (1, 0) const o[2] = (2, 2)"),
    ],
)
def test_a_table_is_its_members(short, long):
    rest = "signal ee[2] spec: F ee.x < 1"
    assert parse_spec(f"{short} {rest}") == parse_spec(f"{long} {rest}")


def test_ranges_are_lists():
    text = "signal x const r[1..3] = (3, 4, 5) let y[i in {}] = x - r[i] "
    text += "spec: (all i in {}: y[i] < 0) | (any i in {}: F y[i] > 0)"
    assert parse_spec(text.format("1..3", "1..2", "2..3")) == parse_spec(text.format("1, 2, 3", "1, 2", "2, 3"))


def test_a_ball_and_a_box_around_a_signal():
    for text, plain in [
        ("G !ball(a, b, 0.5)", "G distance(a, b) > 0.5"),
        ("F box(a, b - (1, 2), b + (1, 2))", "F (-1 < a.x - b.x < 1 & -2 < a.y - b.y < 2)"),
    ]:
        spec, other = (parse_spec(f"signal a[2] signal b[2] spec: {t}") for t in (text, plain))
        values = {"a": EE, "b": PED[0]}
        assert spec.robustness(values) == pytest.approx(other.robustness(values))
        assert spec.regions == ()
