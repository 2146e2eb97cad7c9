"""Which clause is stuck: the sentence, the figure, and files of runs that go on or are older."""

import numpy as np
import pandas as pd

from tltlrl.reports.clauses import Standing, averaged, clauses_figure, read_standing, standings, stuck, stuck_lines

ASKED = {"F G at": ("at",), "G safe": ("safe",)}


def standing(goal_decides, at_met=0.25, safe_met=0.5):
    """Of a spec F G at & G safe, an iteration for each share that its first clause decides."""
    share = np.asarray(goal_decides, dtype=float)
    table = {"iteration": np.arange(len(share))}
    for part, decides, met in (("F G at", share, 0.1), ("G safe", 1 - share, safe_met)):
        table |= {f"clause mean: {part}": -decides, f"clause best: {part}": 1.0, f"clause met: {part}": met}
        table[f"clause decides: {part}"] = decides
    for name, met in (("at", at_met), ("safe", 1.0)):
        table |= {f"name mean: {name}": 0.0, f"name best: {name}": 1.0, f"name met: {name}": met}
        table |= {f"name kept: {name}": 0.0, f"name decides: {name}": 0.5}
    return Standing(("F G at", "G safe"), ("at", "safe"), pd.DataFrame(table).astype(float))


def test_the_sentence_says_since_when_and_how_few_met_it():
    late = stuck(standing([1.0] * 30 + [0.0] * 30), ASKED, 20)
    # The share is that of the last ten iterations: from the 36th on most of those are decided by G safe.
    assert late == "from iteration 35 on `G safe` decides 100 %; it was met by 250 of 500 trajectories"
    never = stuck(standing([0.75] * 40), ASKED, 20)
    assert never == (
        "throughout `F G at` decides 75 %; it was met by 80 of 800 trajectories; `at` at some moment by 200"
    )


def test_where_clauses_take_turns_the_last_ten_iterations_are_told():
    turns = stuck(standing([1.0] * 20 + [0.0] * 20 + [1.0] * 7), ASKED, 20)
    assert turns.startswith("from iteration 37 on `F G at` decides 70 %; it was met by 20 of 200")


def test_only_failed_seeds_are_told_and_older_results_are_passed_over(tmp_path):
    runs = {tmp_path / "a" / f"seed_{seed}": {"satisfied": seed == 0} for seed in range(3)}
    known = {"a": {0: standing([1.0] * 9), 1: standing([1.0] * 9)}}
    lines = stuck_lines(runs, known, ASKED, 20)
    assert [line for line in lines if line.startswith("-")] == [f"- a seed 1: {stuck(known['a'][1], ASKED, 20)}."]
    assert stuck_lines(runs, {}, ASKED, 20) == []
    assert standings(runs) == {}


def test_a_run_that_goes_on_is_read_without_the_line_that_is_not_whole(tmp_path):
    text = standing([1.0, 0.5]).table.to_csv(index=False)
    (tmp_path / "clauses.csv").write_text(text + "2,0.1")
    read = read_standing(tmp_path)
    assert (read.clauses, read.names) == (("F G at", "G safe"), ("at", "safe"))
    np.testing.assert_allclose(read.values("clause", "decides", "G safe"), [0.0, 0.5])
    longer = averaged([read, standing([0.0, 0.0, 0.0])])
    np.testing.assert_allclose(longer.values("clause", "decides", "F G at"), [0.5, 0.25])


def test_every_clause_has_a_line_in_every_case_and_a_style_of_its_own():
    figure = clauses_figure({"a": {0: standing([1.0] * 9)}, "b": {0: standing([0.5] * 9), 1: standing([0.0] * 9)}})
    shares = [axes for axes in figure.axes if axes.get_subplotspec().colspan.start == 0]
    assert [[line.get_label().strip() for line in axes.get_lines()] for axes in shares] == [["F G at", "G safe"]] * 2
    np.testing.assert_allclose(shares[1].get_lines()[0].get_ydata(), 25.0)
    assert len({(line.get_color(), str(line.get_linestyle())) for line in shares[0].get_lines()}) == 2
    assert "Means of 1 seed and 2 seeds." in figure.get_supxlabel()
