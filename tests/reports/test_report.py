from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.logic.reasons import Reason, to_json
from tltlrl.reports.report import (
    bottleneck_lines,
    motion_lines,
    outcome_lines,
    summarise,
    summary_page,
    trial_lines,
)
from tltlrl.simulation.motion import MEASURES

LATE = Reason("`d < 0.2` in at_goal", 1, 199, 199, -0.5, -0.5)
LATER = Reason("`d < 0.2` in at_goal", 1, 150, 150, -0.25, -0.25)
INSIDE = Reason("`d > 0.5 | e` in safe", 2, 10, 12, -0.1, -0.05)


def finished(*runs):
    """(case, seed, why its policy fails, why its trials fail) => what read_results gives of each run."""
    return {
        Path(case) / f"seed_{seed}": {
            "satisfied": not policy,
            "trials": 4,
            "successes": 4 - sum(reason.count for reason in trials),
            "why_policy_fails": to_json(policy),
            "why_trials_fail": to_json(trials),
        }
        for case, seed, policy, trials in runs
    }


def test_what_holds_failed_policies_back_is_counted_over_the_seeds():
    runs = finished(("a", 0, [LATE], []), ("a", 1, [LATER], []), ("a", 2, [], []), ("b", 0, [], []))
    lines = bottleneck_lines(runs, 0.05)
    assert "- a, 2 of 3 seeds:" in lines
    assert (
        "  - 2 of 3: `d < 0.2` in at_goal, at steps 150 to 199 (7.50 to 9.95 s), robustness -0.500 to -0.250" in lines
    )
    assert not any(line.startswith("- b") for line in lines)
    assert bottleneck_lines(finished(("b", 0, [], [])), 0.05) == []


def test_the_trials_of_every_run_with_their_interval_and_reasons():
    runs = finished(("a", 0, [], []), ("a", 1, [], [INSIDE, LATE]))
    lines = trial_lines(summary(runs, bread_in_slot=3), runs, 0.05)
    assert (
        "| case | seed | successful trials (95 % Wilson interval) | with bread in slot | why trials failed |" in lines
    )
    assert "| a | 0 | 4 of 4 (0.510 to 1.000) | 3 of 4 |  |" in lines
    assert (
        "| a | 1 | 1 of 4 (0.046 to 0.699) | 3 of 4 | 2: `d > 0.5 \\| e` in safe, at steps 10 to 12 (0.50 to 0.60 s), "
        "robustness -0.100 to -0.050; 1: `d < 0.2` in at_goal, at step 199 (9.95 s), robustness -0.500 |"
    ) in lines


def test_the_first_satisfied_iteration_is_a_median_over_all_seeds():
    """A seed that never was satisfied counts as later than any other."""
    rows = [("a", 10), ("a", 20), ("a", None), ("b", 10), ("b", None), ("b", None)]
    table = pd.DataFrame(
        {
            "case": case, "seed": seed, "robustness_policy": 0.5, "satisfied": True, "robustness_mean_last": 0.25,
            "first_satisfied_iteration": first, "satisfied_for_good_iteration": first and first + 5,
            "trials": 10, "successes": 7, "success_rate": 0.7,
        }
        for seed, (case, first) in enumerate(rows)
    )  # fmt: skip
    experiment, _ = read(compose(["experiment=reach_avoid"]))
    lines = summary_page(experiment, table, {}).splitlines()
    assert "| a | 3 of 3 | 0.500 (0.500 to 0.500) | 20 | 25 | 0.250 | 21 of 30 |" in lines
    assert "| b | 3 of 3 | 0.500 (0.500 to 0.500) | never | never | 0.250 | 21 of 30 |" in lines


@pytest.mark.parametrize(
    ("values", "first", "for_good"),
    [([-1, 1, -1, 1], 1, 3), ([1, 1], 0, 0), ([1, 1, -1], 0, None), ([-1, -1], None, None), ([-1, 0], None, None)],
)
def test_satisfied_for_good_from_the_iteration_after_the_last_violated_one(values, first, for_good):
    curves = pd.DataFrame(
        {"task": "t", "case": "a", "seed": 0, "iteration": i, "robustness_policy": value, "robustness_mean": 0.0}
        for i, value in enumerate(values)
    )
    done = {"robustness_policy": values[-1], "satisfied": values[-1] > 0, "trials": 1, "successes": 1, "outcomes": {}}
    (row,) = summarise(curves, {Path("a/seed_0"): done}).to_dict("records")
    found = [row["first_satisfied_iteration"], row["satisfied_for_good_iteration"]]
    assert [None if value is pd.NA else value for value in found] == [first, for_good]


def test_where_the_best_policy_is_kept_it_is_the_one_that_satisfies_for_good():
    curves = pd.DataFrame(
        {"task": "t", "case": "a", "seed": 0, "iteration": range(4), "robustness_policy": [-1.0, 1.0, -1.0, 0.5]}
    ).assign(robustness_mean=0.0)
    curves["robustness_kept"] = curves["robustness_policy"].cummax()
    done = {"robustness_policy": 1.0, "satisfied": True, "trials": 1, "successes": 1, "outcomes": {}}
    (row,) = summarise(curves, {Path("a/seed_0"): done}).to_dict("records")
    assert (row["first_satisfied_iteration"], row["satisfied_for_good_iteration"]) == (1, 1)
    other = curves.assign(robustness_kept=np.nan)  # of a case that keeps the last one
    done |= {"robustness_policy": 0.5}
    (row,) = summarise(other, {Path("a/seed_0"): done}).to_dict("records")
    assert (row["first_satisfied_iteration"], row["satisfied_for_good_iteration"]) == (1, 3)


def test_the_outcome_of_every_case_in_a_line():
    rows = [("a", 0, 0.5, 7), ("a", 1, -0.25, 0), ("a", 2, 0.125, 10), ("b", 0, -1.0, 0)]
    table = pd.DataFrame(
        {"case": case, "seed": seed, "robustness_policy": value, "satisfied": value > 0, "trials": 10, "successes": n}
        for case, seed, value, n in rows
    )
    assert outcome_lines(table) == [
        "a: satisfied 2 of 3; robustness 0.125, -0.250 to 0.500; trials 17 of 30",
        "b: satisfied 0 of 1; robustness -1.000; trials 0 of 10",
    ]


def test_of_enough_seeds_the_mean_has_its_interval():
    table = pd.DataFrame(
        {
            "case": "a", "seed": seed, "robustness_policy": 0.5, "satisfied": True, "robustness_mean_last": seed + 1.0,
            "first_satisfied_iteration": 3, "satisfied_for_good_iteration": 3,
            "trials": 10, "successes": 7, "success_rate": 0.7,
        }
        for seed in range(6)
    )  # fmt: skip
    experiment, _ = read(compose(["experiment=reach_avoid"]))
    page = summary_page(experiment, table, {})
    assert "| robustness of samples, last iteration, mean (95 % t interval) |" in page
    assert "| 3.500 (1.537 to 5.463) |" in page


def summary(runs, **judged):
    return pd.DataFrame(
        {
            "case": path.parent.name, "seed": int(path.name[5:]), "trials": done["trials"],
            "successes": done["successes"], "success_rate": done["successes"] / done["trials"], **judged,
        }
        for path, done in runs.items()
    )  # fmt: skip


def test_how_policies_move_stands_in_the_summary_and_as_medians_in_the_report():
    """Results of 0.1 have no measures, and a case without any has empty cells."""
    results = finished(("a", 0, [], []), ("a", 1, [], []), ("b", 0, [], []))
    for done in results.values():
        done |= {"robustness_policy": 0.5, "outcomes": {}}
    curves = pd.DataFrame(
        {"task": "t", "case": case, "seed": seed, "iteration": 0, "robustness_policy": 0.5, "robustness_mean": 0.25}
        for case, seed in (("a", 0), ("a", 1), ("b", 0))
    )
    assert motion_lines(summarise(curves, results)) == []
    for done, length in zip(list(results.values())[:2], (2.0, 5.0), strict=True):
        done["motion"] = {"path_length": length, "time_to_satisfaction": None}
    table = summarise(curves, results)
    assert list(table["path_length"].fillna(-1)) == [2.0, 5.0, -1.0]
    lines = motion_lines(table)
    assert lines[5:] == [
        "| case | path length |", "|---|---|", "| a | 3.5 |", "| b |  |", "", "- path length: m, of the end-effector",
    ]  # fmt: skip


def test_calm_policies_stand_beside_the_learned_ones_and_are_not_counted_among_them():
    worth = {
        "robustness_policy": 0.4, "satisfied": True, "trials": 4, "successes": 4, "outcomes": {"bread": 3},
        "motion": dict.fromkeys(MEASURES, 2.0),
    }  # fmt: skip
    calm = worth | {"robustness_policy": 0.3, "episodes": 160, "env_steps": 9, "motion": dict.fromkeys(MEASURES, 1.0)}
    rows = {"task": "t", "case": "a", "seed": [0, 1], "iteration": 0, "robustness_policy": 0.4, "robustness_mean": 0.1}
    table = summarise(pd.DataFrame(rows), {Path("a/seed_0"): worth | {"calm": calm}, Path("a/seed_1"): worth})
    lines = motion_lines(table)
    assert "| a |" + " 2 |" * len(MEASURES) in lines
    assert "| a, calm |" + " 1 |" * len(MEASURES) in lines
    assert "| a | 1 of 1 | 0.300 (0.300 to 0.300) | 0.75 | 4 of 4 | 3 of 4 | 160 |" in lines
    experiment, _ = read(compose(["experiment=reach_avoid"]))
    assert "| 8 of 8 | 6 of 8 |" in summary_page(experiment, table, {})
    assert table["calm_path_length"].isna().tolist() == [False, True]
