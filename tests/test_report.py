import pandas as pd

from tltlrl.report import claim_lines


def summary(tltl, continuous, step):
    rows = [("tltl_episodic", tltl), ("continuous_episodic", continuous), ("continuous_step", step)]
    return pd.DataFrame(
        {"case": case, "seed": seed, "robustness_policy": value, "robustness_mean_over_run": value - 0.5}
        for case, values in rows for seed, value in enumerate(values)
    )  # fmt: skip


def test_claims_follow_the_numbers():
    better = "\n".join(claim_lines(summary([0.2, 0.3, 0.2], [0.1, 0.0, 0.1], [0.1, 0.1, 0.15])))
    assert "best rate of convergence: so it was on these 3 seeds, too few or too much alike to tell" in better
    certain = "\n".join(claim_lines(summary([0.2] * 7, [0.1] * 7, [0.0] * 7)))
    assert "best final value: confirmed (n = 7, p < 0.05)" in certain
    assert "| tltl_episodic | continuous_episodic | robustness_policy | 3 | +0.167 | 1.00 | 0.500 |" in better
    worse = "\n".join(claim_lines(summary([0.2, 0.3, 0.2], [0.1, 0.0, 0.1], [0.4, 0.1, 0.5])))
    assert "best final value: not confirmed" in worse


def test_one_case_alone_claims_nothing():
    assert claim_lines(summary([0.2], [0.1], [0.1]).query("case == 'tltl_episodic'")) == [""]
