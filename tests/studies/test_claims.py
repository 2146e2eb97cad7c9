import pandas as pd
import pytest

from studies.claims import CLAIMS, claim_lines, main
from tltlrl.registry import TASKS


def summary(task="visit_in_order", successes=0, **cases):
    """One row per case and seed, from the final robustness of each seed; the rate is half a metre lower."""
    return pd.DataFrame(
        {
            "task": task, "case": case, "seed": seed, "robustness_policy": value, "satisfied": value > 0,
            "robustness_mean_over_run": value - 0.5, "trials": 10,
            "successes": 10 if case == "tltl_episodic" else successes,
        }
        for case, values in cases.items() for seed, value in enumerate(values)
    )  # fmt: skip


def verdict(lines, words):
    """The answer that follows a quote with these words."""
    (line,) = (line for line in lines if words in line and line.startswith('"'))
    return line.split('": ')[1]


def test_best_in_rate_and_final_value():
    few = claim_lines(
        summary(tltl_episodic=[0.2, 0.3, 0.2], continuous_episodic=[0.1, 0.0, 0.1], continuous_step=[0.1, 0.1, 0.15])
    )
    assert verdict(few, "best learning outcome") == (
        "**so it was with n = 3, too few seeds or too much alike to tell (largest p 0.50)**."
    )
    assert "| tltl_episodic | continuous_episodic | robustness_policy | 3 | +0.167 | 1.00 | 0.500 |" in few
    many = claim_lines(summary(tltl_episodic=[0.2] * 7, continuous_episodic=[0.1] * 7))
    assert verdict(many, "best learning outcome") == "**confirmed (n = 7, p < 0.05)**."
    worse = claim_lines(summary(tltl_episodic=[0.2, 0.3], continuous_episodic=[0.4, 0.1]))
    assert verdict(worse, "best learning outcome") == "**not confirmed**."
    (row,) = (line for line in claim_lines(summary(tltl_episodic=[0.2] * 12, continuous_episodic=[0.1] * 12))
              if "| robustness_policy |" in line and "continuous_episodic" in line)  # fmt: skip
    assert row.endswith("| < 0.001 |")


@pytest.mark.parametrize(
    ("step", "expected"),
    [
        ([-0.1, -0.1], "**no gain for the continuous reward**."),
        ([0.04, 0.04], "**for the continuous reward a gain that cannot be told from none (p 0.50)**."),
        ([0.04] * 7, "**confirmed for the continuous reward**."),
        ([0.15] * 7, "**more than minor for the continuous reward**."),
    ],
)
def test_minor_is_less_than_half_of_what_is_lacking(step, expected):
    n = len(step)
    lines = claim_lines(summary(tltl_episodic=[0.2] * n, continuous_episodic=[0.0] * n, continuous_step=step))
    assert verdict(lines, "minor improvement") == expected


def test_both_rewards_are_one_family_and_the_spread_is_told():
    lines = claim_lines(
        summary(
            tltl_episodic=[0.2] * 6,
            discrete_episodic=[0.0] * 6, discrete_step=[0.04] * 6,
            continuous_episodic=[0.0, 0.1] * 3, continuous_step=[0.05, 0.14] * 3,
        )
    )  # fmt: skip
    rows = [line for line in lines if line.startswith(("| discrete_step", "| continuous_step"))]
    assert [row.split(" | ")[-1] for row in rows] == ["0.062 |", "0.062 |"]  # 2 x 2 / 2^6
    assert any("discrete 0.000 to 0.000, not less; continuous 0.055 to 0.049, less." in line for line in lines)


def test_comparable_needs_the_seeds_and_nine_tenths_of_the_value():
    def of(continuous):
        lines = claim_lines(summary("reach_avoid", tltl_episodic=[0.2, 0.2], continuous_episodic=continuous))
        return verdict(lines, "comparable")

    assert of([0.19, 0.18]) == "**confirmed for continuous_episodic (n = 2)**."
    assert of([0.17, 0.18]) == "**not confirmed**."
    assert of([0.9, -0.1]) == "**not confirmed**."


def test_a_considerable_margin_leaves_no_seed_between():
    def of(tltl, other):
        return verdict(claim_lines(summary(tltl_episodic=tltl, discrete_step=other)), "considerable margin")

    assert of([0.2, 0.1], [0.05, -1.0]) == "**confirmed (n = 2)**."
    assert of([0.2, 0.1], [0.15, -1.0]) == "**not confirmed**."


def test_discrete_fails_if_no_seed_succeeds():
    def of(*discrete):
        return verdict(claim_lines(summary(tltl_episodic=[0.2], discrete_step=discrete)), "fails to learn a useful")

    assert of(-0.1, -1.0) == "**confirmed (n = 2)**."
    assert of(-0.1, 0.1) == "**not confirmed, discrete_step did on some seeds**."


@pytest.mark.parametrize(("successes", "expected"), [(0, "**confirmed (n = 2)**."), (1, "**not confirmed**.")])
def test_the_ten_trials_of_the_toast_task(successes, expected):
    lines = claim_lines(summary("toast", successes, tltl_episodic=[0.1, 0.1], continuous_episodic=[-0.1, -0.1]))
    assert verdict(lines, "100% success rate") == expected
    counts = f"20 of 20 trials with TLTL, {2 * successes} of 20 with the comparison reward."
    assert any(line.endswith(counts) for line in lines)


def test_claims_are_made_of_their_own_tasks_only():
    assert {task for claim in CLAIMS for task in claim.tasks} == set(TASKS.built_in)
    for words in ("comparable", "100% success"):
        assert not any(words in line for line in claim_lines(summary(tltl_episodic=[0.2], continuous_episodic=[0.1])))


def test_one_case_alone_claims_nothing():
    assert claim_lines(summary("reach_avoid", tltl_episodic=[0.2])) == []


def test_the_command_writes_a_page_beside_each_summary(tmp_path, capsys):
    for task in ("reach_avoid", "toast"):
        (tmp_path / task).mkdir()
        table = summary(task, tltl_episodic=[0.2, 0.1], continuous_episodic=[-0.1, -0.2])
        table.to_csv(tmp_path / task / "summary.csv", index=False)
    assert main([str(tmp_path / "reach_avoid"), str(tmp_path / "toast")]) == 0
    page = (tmp_path / "toast/claims.md").read_text()
    assert page.startswith("# toast\n\n## What the case study claims\n")
    assert "**confirmed (n = 2)**" in page
    assert page in capsys.readouterr().out


def test_cases_of_which_nothing_is_claimed(tmp_path):
    summary("reach_avoid", tltl_episodic=[0.2]).to_csv(tmp_path / "summary.csv", index=False)
    assert main([str(tmp_path)]) == 0
    assert (tmp_path / "claims.md").read_text().endswith("The case study claims nothing of these cases.\n")


def test_a_folder_without_a_summary_is_told_and_nothing_is_written(tmp_path, capsys):
    summary("reach_avoid", tltl_episodic=[0.2]).to_csv(tmp_path / "summary.csv", index=False)
    assert main([str(tmp_path), str(tmp_path / "none")]) == 2
    said = capsys.readouterr().err
    assert f"{tmp_path / 'none'}/summary.csv cannot be read (" in said
    assert said.endswith("; tltl-run writes it when a run has finished\n")
    assert not (tmp_path / "claims.md").exists()
