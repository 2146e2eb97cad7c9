import json

import numpy as np

from tltlrl.logic import parse_spec
from tltlrl.logic.reasons import Reason, failed, from_json, merge, to_json

SPEC = parse_spec("signal x\ndef low: x < 1\ndef high: x > 0.4\nspec: G low & F high")


def explanations(*rows):
    return SPEC.explain({"x": np.array(rows)})


def test_the_predicate_that_decides_is_named_with_its_steps_and_values():
    first, second = failed(explanations([0.0, 1.5, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, 2.25], [0.0, 0.25, 0.0]))
    assert first.told(0.05) == "`x < 1` in low, at steps 1 to 2 (0.05 to 0.10 s), robustness -1.250 to -0.500"
    assert second.told(0.05) == "`x > 0.4` in high, at step 1 (0.05 s), robustness -0.150"


def test_a_negated_predicate_is_shown_negated():
    spec = parse_spec("signal x\ndef high: x > 3\nspec: G !high")
    (reason,) = failed(spec.explain({"x": np.array([[0.0, 5.0]])}))
    assert reason.told(0.05) == "`!(x > 3)` in high, at step 1 (0.05 s), robustness -2.000"


def test_the_end_of_the_trajectory_can_decide():
    (reason,) = failed(parse_spec("X[!] (x > 0)").explain({"x": np.array([[1.0]])}))
    assert reason.what == "the end of the trajectory"


def test_merged_reasons_are_counted_most_frequent_first():
    a, b = Reason("a", 1, 5, 5, -1.0, -1.0), Reason("b", 2, 3, 4, -0.5, -0.25)
    merged = merge([a, b, Reason("a", 2, 1, 2, -3.0, -0.5)])
    assert merged == [Reason("a", 3, 1, 5, -3.0, -0.5), b]


def test_reasons_survive_json():
    reasons = [Reason("`x < 1` in low", 3, 0, 7, -1.5, -0.25)]
    assert from_json(json.loads(json.dumps(to_json(reasons)))) == reasons
