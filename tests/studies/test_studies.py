"""The studies train what the product trains, and their rules are what they say."""

import dataclasses
import json
import re

import numpy as np
import pandas as pd
import pytest

from studies import covariance, grid_search, learners, smoothness
from studies.claims import claim_lines
from studies.lockstep import Kinematic, Learner, train
from tltlrl.cli import main as cli
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.learning.reps import fit
from tltlrl.reports.report import summary_page
from tltlrl.simulation.rollout import Simulator
from tltlrl.training import build
from tltlrl.training.loop import iterate
from tltlrl.training.start import first_policy

STUDIES = covariance.RESULTS.parent
DOCS = STUDIES.parent / "docs"
# Some touch the table and end early; what they command after that is no part of the robustness.
TOUCHING_THE_TABLE = ("algorithm.initial_std=1.0", "algorithm.feedback=-1.0", "spec=toast_smooth.tltl")


@pytest.mark.parametrize(
    ("experiment", "case"),
    [
        ("visit_in_order", "tltl_episodic"),
        ("visit_in_order", "continuous_episodic"),
        ("visit_in_order", "continuous_step"),
        ("toast", "tltl_episodic"),
        ("toast", "continuous_episodic"),
    ],
)
def test_runs_in_lockstep_are_the_products_runs(experiment, case):
    settings = [f"experiment={experiment}", f"cases=[{case}]", "seeds=[3, 8]", "algorithm.samples=5"]
    study, _ = read(compose([*settings, *(TOUCHING_THE_TABLE if experiment == "toast" else ())]))
    runs = study.runs()
    a, own = runs[0].algorithm, runs[0].learner
    task, reward = build.make_task(study.task), build.make_reward(runs[0])

    def rule(*arguments):
        return fit(*arguments, own.covariance, own.kept)

    learners = [Learner(run.seed, rule, own.epsilon, reward, run.case.learner == "step") for run in runs]
    curves = train(task, runs[0].spec, Simulator(task), first_policy(task, a), learners, a.samples, 3)
    ended_early = 0
    for j, run in enumerate(runs):
        setup = build.set_up(run)
        state = setup.learner.start(first_policy(task, a))
        for i in range(3):
            result = iterate(run, setup, state, i)
            state = result.state
            ended_early += result.env_steps < a.samples * task.steps
            np.testing.assert_allclose(curves.samples[i, j], result.record["robustness_mean"], rtol=1e-9)
            np.testing.assert_allclose(curves.policy[i, j], result.record["robustness_policy"], rtol=1e-9)
    assert (ended_early > 0) == (experiment == "toast")


def test_the_kinematic_model_stays_within_six_centimetres_of_the_simulation_under_full_exploration():
    study, _ = read(compose(["experiment=visit_in_order"]))
    task, rng = build.make_task(study.task), np.random.default_rng(0)
    policy = first_policy(task, study.algorithm)
    offsets, noise = policy.sample(5, rng), np.zeros((5, task.steps, 3))
    ends = [kind(task).rollout(policy.gain, offsets, noise).features[..., 6:8] for kind in (Kinematic, Simulator)]
    assert np.linalg.norm(ends[0] - ends[1], axis=-1).max() < 0.06


def test_bounded_rule_reaches_its_bound_and_otherwise_is_the_diagonal_fit():
    rng = np.random.default_rng(0)
    mean, old = rng.normal(size=(4, 3)), np.tile(np.diag([1.0, 2.0, 0.5]), (4, 1, 1))
    offsets, weights = mean + rng.normal(size=(12, 4, 3)), np.full((4, 12), 1 / 12)
    weights[0, :6] *= np.linspace(0.5, 1.5, 6)
    new, s = covariance.bounded(0.05)(offsets, weights, mean, old)
    shift, precision = new - mean, np.linalg.inv(s)
    kl = 0.5 * (
        np.trace(precision @ old, axis1=1, axis2=2)
        + np.einsum("ti,tij,tj->t", shift, precision, shift)
        - 3
        + np.linalg.slogdet(s)[1]
        - np.linalg.slogdet(old)[1]
    )
    np.testing.assert_allclose(kl, 0.05, atol=1e-4)
    free_mean, free = covariance.bounded(1e9)(offsets, weights, mean, old)
    fitted_mean, fitted = covariance.published(offsets, weights, mean, old)
    np.testing.assert_allclose(free_mean, fitted_mean, atol=1e-4)
    np.testing.assert_allclose(free, fitted * np.eye(3), atol=1e-4)


def test_grid_search_gives_one_row_per_point_and_seed():
    results = grid_search.search("reach_avoid", "continuous_step", [{"c2": 0.0}, {"c2": 0.3}], [100, 101], True, 2)
    assert list(zip(results["c2"], results["seed"], strict=True)) == [(0.0, 100), (0.0, 101), (0.3, 100), (0.3, 101)]
    assert results["robustness_policy"].nunique() == 4


def test_grid_search_of_the_toast_task_is_in_mujoco_and_episode_based(tmp_path, monkeypatch):
    assert not set(grid_search.MORE_SEEDS) & set(grid_search.SEEDS)
    assert len(grid_search.points("toast", "continuous")) == 36
    monkeypatch.setitem(grid_search.GRIDS, ("toast", "continuous"), {"c2": (0.0, 0.9), "c3": (0.001, 0.01, 0.1)})
    monkeypatch.setattr(grid_search, "MORE_SEEDS", grid_search.MORE_SEEDS[:2])
    grid_search.main(["toast", "--iterations", "1", "--seeds", "100", "--finalists", "1", "--output", str(tmp_path)])
    results = pd.read_csv(tmp_path / "grid_search_toast.csv")
    assert set(results["physics"]) == {"mujoco"}
    assert set(results["case"]) == {"continuous_episodic"}
    first, again = results[results["seed"] == 100], results[results["seed"] != 100]
    assert len(first[["c2", "c3"]].drop_duplicates()) == len(first) == 6
    assert set(again["seed"]) == set(grid_search.MORE_SEEDS)
    assert len(again) == 2
    assert len(again[["c2", "c3"]].drop_duplicates()) == 1


def test_movement_is_measured_up_to_each_trajectorys_end():
    nan = np.nan
    velocities = np.array([[[0.0], [0.05], [0.15]], [[0.0], [-0.15], [nan]]])
    commands = np.array([[[0.1, 7], [0.1, 9], [0.3, 1]], [[0.5, 0], [0.3, 0], [nan, 0]]])  # the second is the gripper's
    moved = smoothness.movement({"velocities": velocities, "command": commands}, np.array([3, 2]), 0.05)
    expected = {
        "acceleration_rms": np.sqrt((1 + 4 + 9) / 3),
        "acceleration_peak": 3.0,
        "command_change_rms": np.sqrt((0 + 0.04 + 0.04) / 3),
        "command_peak": 0.5,
    }
    assert moved == pytest.approx(expected)


@pytest.mark.usefixtures("without_pictures")
def test_smoothness_judges_the_policies_and_trials_of_the_summary(tmp_path):
    small = [
        "cases=[tltl_episodic]",
        "seeds=1",
        "workers=1",
        "trials=2",
        "algorithm.iterations=1",
        f"runs_dir={tmp_path}",
    ]
    for name in ("toast", "toast_smooth"):
        assert cli.run(["experiment=toast", f"name={name}", f"spec={name}.tltl", *small]) == 0
    folders = [tmp_path / "toast", tmp_path / "toast_smooth"]
    results = smoothness.table(folders)
    assert results[["folder", "seed"]].to_numpy().tolist() == [
        ["toast", -1],
        ["toast", 0],
        ["toast_smooth", -1],
        ["toast_smooth", 0],
    ]
    for name, folder in zip(("toast", "toast_smooth"), folders, strict=True):
        done = json.loads((folder / "tltl_episodic/seed_0/done.json").read_text())
        (row,) = results[(results["folder"] == name) & (results["seed"] == 0)].to_dict("records")
        assert row[f"mean_{name}"] == done["robustness_policy"]
        assert row[f"trials_{name}"] == done["successes"]
        assert row["trials_bread_in_slot"] == done["outcomes"]["bread_in_slot"]
        assert row["mean_toast_smooth"] <= row["mean_toast"]  # the bounds only ever take away


def test_every_rule_can_be_named_on_the_command_line():
    for text in ("published", "damped:0.3,epsilon=0.5", "damped_about_new:0.5", "bounded:0.1", "shared", "floored:0.1"):
        setting = covariance.parse_setting(text)
        assert callable(setting.fit())
    assert dataclasses.asdict(covariance.parse_setting("damped:0.3,epsilon=0.5"))["epsilon"] == 0.5


def test_pages_show_the_tables_of_their_csv_files():
    rows = pd.read_csv(covariance.RESULTS)
    page = (DOCS / "covariance.md").read_text()
    overviews = "\n".join(covariance.overview(part) for _, part in rows.groupby("physics"))
    for line in (overviews + covariance.table(rows)).splitlines():
        assert line in page, line
    results = (DOCS / "results.md").read_text()
    toast = pd.read_csv(STUDIES / "toast.csv").query("spec == 'toast.tltl'").drop(columns="spec")
    for line in summary_page(read(compose(["experiment=toast"]))[0], toast, {}).splitlines():
        assert not line.startswith("|") or line in (DOCS / "toast-notes.md").read_text(), line
    for task, summary in pd.read_csv(STUDIES / "results.csv").groupby("task"):
        assert "\n".join(claim_lines(summary)).replace("## ", "### ").strip() in results, task
        experiment, _ = read(compose([f"experiment={task}"]))
        for line in summary_page(experiment, summary, {}).splitlines():
            assert not line.startswith("|") or line in results, line
    online = (DOCS / "online.md").read_text()
    for task, summary in pd.read_csv(STUDIES / "step.csv").groupby("task"):
        experiment, _ = read(compose([f"experiment={task}"]))
        for line in summary_page(experiment, summary, {}).splitlines()[6:]:
            case, satisfied, robustness, first, for_good, _, successes, *_ = line[2:].split(" | ")
            row = [task, case, satisfied, first, for_good, robustness, successes.removesuffix(" |")]
            assert f"| {' | '.join(row)} |" in online, line


def cells_of(page, *first):
    """The cells of the one row of a page's tables that begins with these."""
    (row,) = re.findall(rf"^\| {re.escape(' | '.join(first))} \| (.*) \|$", (DOCS / page).read_text(), re.MULTILINE)
    return [cell.strip() for cell in row.split("|")]


def as_printed(cell, values):
    """Numbers with as many digits as those of a cell, in its words."""
    numbers = iter(values)
    return re.sub(r"-?\d[\d ]*(\.\d+)?", lambda at: f"{next(numbers):.{len(at[1] or '.') - 1}f}", cell)


def test_the_page_on_learners_shows_its_csv_file():
    rows = pd.read_csv(STUDIES / "learners.csv")
    groups = rows.groupby(["task", "learner"], sort=False)
    for (_, own), told in zip(groups, learners.overview(rows).to_dict("records"), strict=True):
        satisfied, first, good, robustness, share, trials = cells_of(
            "learners.md", told["task"], told["learner"].replace("_", ", ")
        )
        value = own["robustness_policy"]
        assert [satisfied, first, good, trials] == [told[name] for name in ("satisfied", "first", "for good", "trials")]
        assert robustness == as_printed(robustness, [value.median(), value.min()])
        assert share == as_printed(share, [own["share_of_best"].median()])


def test_the_page_on_learners_shows_what_comes_out_of_the_best_experiments():
    rows = pd.read_csv(STUDIES / "learners.csv").query("learner == 'best'")
    best = rows.assign(learner=rows["task"] + "_best")
    calm = pd.read_csv(STUDIES / "calm.csv").query("policy == 'calm'").groupby("folder")["episodes"].median()
    for name, own in pd.concat([best, pd.read_csv(STUDIES / "starts.csv")]).groupby("learner"):
        episodes, of_calm, satisfied, good, robustness, trials = cells_of("learners.md", name)
        (count,) = own["episodes"].unique()
        assert int(episodes.replace(" ", "")) == count
        assert of_calm.replace(" ", "") == (f"{calm[name]:.0f}" if name in calm else "")
        assert satisfied == f"{own['satisfied'].sum()} of {len(own)}"
        assert good == as_printed(good, [own["for_good"].median(), own["for_good"].max()])
        value = own["robustness_policy"]
        assert robustness == as_printed(robustness, [value.median(), value.min(), value.max()])
        told = f"{own['successes'].sum()} of {own['trials'].sum()}"
        assert trials.partition(",")[0] == told
        if own["bread_in_slot"].notna().all():
            assert trials == f"{told}, bread {own['bread_in_slot'].sum():.0f}"


def test_the_page_on_calm_motions_shows_its_csv_file_whose_policies_are_those_of_the_learners():
    rows, learned = (pd.read_csv(STUDIES / f"{name}.csv") for name in ("calm", "learners"))
    for (folder, policy), own in rows.groupby(["folder", "policy"]):
        (batches,) = own["batches"].unique()
        path, acceleration, robustness, trials, *_ = cells_of("calm.md", f"{folder}, {policy}", str(batches))
        for cell, name in ((path, "path_length"), (acceleration, "acceleration_rms")):
            assert cell == as_printed(cell, [own[name].median(), own[name].max()])
        assert robustness == as_printed(robustness, [own["robustness"].median()])
        bread = own["trials_bread_in_slot"]
        counts = f"{own['trials_satisfied'].sum()} of {own['trials'].sum()}"
        assert trials == counts + ("" if bread.isna().all() else f", bread {bread.sum():.0f}")
        if policy == "learned":
            best = learned.query(f"task == '{folder.removesuffix('_best')}' and learner == 'best'")
            np.testing.assert_allclose(own["robustness"], best["robustness_policy"], rtol=1e-12)


def test_learners_are_compared_by_when_they_satisfy_for_good(tmp_path):
    """Of three runs one satisfies from the third iteration on, one from the first, and one loses it again."""
    kept = {0: [-0.1, 0.1, -0.1, 0.1], 1: [0.1, 0.1, 0.1, 0.1], 2: [0.1, 0.1, 0.1, -0.1]}
    curves = pd.DataFrame(
        {"case": "tltl_episodic", "seed": seed, "iteration": i, "episodes": 10 * (i + 1), "robustness_policy": value}
        for seed, values in kept.items()
        for i, value in enumerate(values)
    )
    curves.to_csv(tmp_path / "learning_curves.csv", index=False)
    last = pd.DataFrame({"seed": list(kept), "robustness_policy": [values[-1] for values in kept.values()]})
    last = last.assign(
        case="tltl_episodic",
        satisfied=last.robustness_policy > 0,
        first_satisfied_iteration=[1, 0, 0],
        trials=10,
        successes=[10, 9, 0],
    )
    last.to_csv(tmp_path / "summary.csv", index=False)
    rows = learners.rows_of(tmp_path, "reach_avoid", "episodic")
    assert rows["for_good"].tolist() == [3, 0, pd.NA]
    assert rows["share_of_best"].tolist() == pytest.approx([0.5, 0.5, -0.5])
    (row,) = learners.overview(rows).to_dict("records")
    assert (row["satisfied"], row["for good"], row["trials"], row["episodes"]) == ("2 of 3", "3", "19 of 30", 40)
    curves["robustness_kept"] = 0.1  # of a run that keeps the best: this is what counts
    curves.to_csv(tmp_path / "learning_curves.csv", index=False)
    assert learners.rows_of(tmp_path, "reach_avoid", "best")["for_good"].tolist() == [0, 0, pd.NA]


def test_runs_that_the_figures_left_are_taken_if_they_have_all_seeds(tmp_path):
    (tmp_path / "toast").mkdir()
    table = pd.DataFrame({"case": ["tltl_episodic"] * 3 + ["discrete_step"] * 4, "seed": [0, 1, 2, 0, 1, 2, 3]})
    table.to_csv(tmp_path / "toast" / "summary.csv", index=False)
    assert learners.made_before("toast", "episodic", 3, tmp_path) == tmp_path / "toast"
    assert learners.made_before("toast", "episodic", 4, tmp_path) is None
    assert learners.made_before("toast", "best", 3, tmp_path) is None
    assert learners.made_before("toast", "cma_basis", 3, tmp_path) is None


def test_every_learner_of_the_table_is_one_that_tltl_run_accepts(tmp_path):
    for task in learners.BEST:
        for name in learners.LEARNERS:
            study, _ = read(compose(learners.command(task, name, 20, tmp_path)))
            assert (len(study.runs()), study.name) == (20, f"learners_{task}_{name}")
