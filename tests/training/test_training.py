"""One run: what its rows mean, and that it goes on from any moment to the same bytes."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.errors import UserError
from tltlrl.learning.reps import reward_to_go, solve_dual
from tltlrl.learning.scores import leximin
from tltlrl.logic import telescope
from tltlrl.simulation.trials import mean_motion
from tltlrl.store.files import read_arrays, write_arrays
from tltlrl.store.run import DamagedError, read_results
from tltlrl.training import calm as calm_module
from tltlrl.training import session
from tltlrl.training.build import make_reward, set_up
from tltlrl.training.calm import calmer
from tltlrl.training.learned import learned_policy
from tltlrl.training.loop import iterate
from tltlrl.training.session import train
from tltlrl.training.start import first_policy, refined_policy
from tltlrl.training.study import AlgorithmConfig
from tltlrl.training.verdict import try_policy

SETTINGS = (
    "experiment=reach_avoid", "seeds=[5]", "trials=4", "task.steps=30", "algorithm.iterations=6",
    "algorithm.samples=7", "algorithm.epsilon=0.5",
)  # fmt: skip


def runs(*overrides):
    return {run.case.name: run for run in read(compose([*SETTINGS, *overrides]))[0].runs()}


@pytest.fixture(scope="module")
def cases():
    return runs()


def test_step_based_reps_has_coefficients_of_its_own():
    changed = runs("reward.c2=0.3", "reward.step.c2=0.1", "cases=[continuous_episodic,continuous_step]")
    ee = {"ee": np.zeros((1, 1, 2))}
    for case, c2 in (("continuous_episodic", 0.3), ("continuous_step", 0.1)):
        run = changed[case]
        obstacles = run.spec.constants["obstacle"].values()
        expected = -np.linalg.norm(run.spec.constants["goal"]) + c2 * sum(np.linalg.norm(o) for o in obstacles)
        np.testing.assert_allclose(make_reward(run)(ee)[0], [[expected]])


def by_hand(run, iteration=0):
    """The sampled trajectories of the first policy's iteration, rebuilt from the definition."""
    setup = set_up(run)
    task, simulator, policy = setup.task, setup.simulator, first_policy(setup.task, run.algorithm)
    rng = np.random.default_rng([run.seed, iteration])
    offsets = policy.sample(run.algorithm.samples, rng)
    noise = simulator.draw_command_noise(run.algorithm.samples, rng)
    trajectories = simulator.rollout(policy.gain, offsets, noise)
    return setup, policy, offsets, task.signals(trajectories.features, trajectories.commands)


def test_every_cases_robustness_is_of_its_own_samples_by_the_same_spec(cases):
    for run in cases.values():
        setup, policy, _, signals = by_hand(run)
        robustness = run.spec.robustness(signals)
        record = iterate(run, setup, setup.learner.start(policy), 0).record
        np.testing.assert_allclose(record["robustness_mean"], robustness.mean(), atol=1e-9)
        np.testing.assert_allclose(record["robustness_std"], robustness.std(), atol=1e-9)
        np.testing.assert_allclose(record["robustness_min"], robustness.min(), atol=1e-9)
        np.testing.assert_allclose(record["robustness_max"], robustness.max(), atol=1e-9)
        assert record["satisfied_fraction"] == np.mean(robustness > 0)


def test_each_case_learns_from_its_own_reward(cases):
    for name, run in (cases | runs("cases=[tltl_step]")).items():
        setup, policy, offsets, signals = by_hand(run)
        result = iterate(run, setup, setup.learner.start(policy), 0)
        if run.case.reward == "tltl":
            returns, rewards = run.spec.robustness(signals), telescope(run.spec, signals)
        else:
            rewards, _ = setup.reward(signals)
            returns = rewards.sum(axis=1)
        np.testing.assert_allclose(result.record["return_mean"], returns.mean(), atol=1e-9)
        scores = reward_to_go(rewards).T if run.case.learner == "step" else returns[None]
        weights = np.broadcast_to(solve_dual(scores, 0.5).weights, (setup.task.steps, 7))
        expected = np.einsum("ti,itd->td", weights, offsets)
        np.testing.assert_allclose(result.state.mean, expected, atol=1e-6, err_msg=name)


def test_the_policys_robustness_is_that_of_the_noise_free_mean(cases):
    run = cases["tltl_episodic"]
    setup, policy, _, _ = by_hand(run)
    motion = setup.simulator.rollout(policy.gain, policy.mean[None], np.zeros((1, 30, 3)))
    expected = run.spec.robustness(setup.task.signals(motion.features, motion.commands))[0]
    record = iterate(run, setup, setup.learner.start(policy), 0).record
    np.testing.assert_allclose(record["robustness_policy"], expected, atol=1e-9)


class Stop(Exception):
    pass


@pytest.mark.parametrize("stop_at", [1, 2, 5, 6])
@pytest.mark.parametrize("checkpoint_seconds", [0.0, 1e9])
def test_stopped_after_any_iteration_it_ends_with_the_same_bytes(
    cases, tmp_path, monkeypatch, stop_at, checkpoint_seconds
):
    run = cases["continuous_step"]
    train(run, tmp_path / "undisturbed", lambda _: None)
    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", checkpoint_seconds)

    def stop(iteration):
        if iteration == stop_at:
            raise Stop

    with pytest.raises(Stop):
        train(run, tmp_path / "stopped", stop)
    assert not (tmp_path / "stopped" / "done.json").exists()
    first = []
    train(run, tmp_path / "stopped", first.append)
    assert first[0] == (stop_at if checkpoint_seconds == 0.0 else 1)  # it went on from the last checkpoint
    for name in ("progress.csv", "clauses.csv", "policy.npz", "done.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "undisturbed" / name).read_bytes(), name
    assert not (tmp_path / "stopped" / "checkpoint.npz").exists()


def test_diagnostics_that_change_are_told_and_never_stand_under_other_names(cases, tmp_path, monkeypatch):
    """Before a stop and after it."""
    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", 0.0)

    def renaming(run, setup, state, i):
        result = iterate(run, setup, state, i)
        return replace(result, record=result.record | ({"eta_of_phase_two": 1.0} if i == 3 else {}))

    monkeypatch.setattr(session, "iterate", renaming)
    for _ in range(2):  # the second start resumes at iteration 3
        with pytest.raises(ValueError, match=r"diagnostics changed at iteration 3: .*eta_of_phase_two"):
            train(cases["tltl_episodic"], tmp_path, lambda _: None)
    assert "eta_of_phase_two" not in (tmp_path / "progress.csv").read_text()


@pytest.mark.parametrize("damage", ["truncated", "missing", "csv too short", "csv missing", "no clauses.csv", "forged"])
def test_a_damaged_checkpoint_starts_the_run_again(cases, tmp_path, monkeypatch, damage):
    run = cases["tltl_episodic"]
    train(run, tmp_path / "undisturbed", lambda _: None)
    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", 0.0)

    def stop(iteration):
        if iteration == 4:
            raise Stop

    folder = tmp_path / "damaged"
    with pytest.raises(Stop):
        train(run, folder, stop)
    checkpoint, progress = folder / "checkpoint.npz", folder / "progress.csv"
    if damage == "truncated":
        checkpoint.write_bytes(checkpoint.read_bytes()[:100])
    elif damage == "missing":
        checkpoint.unlink()
    elif damage == "forged":
        forge(checkpoint)
    elif damage == "no clauses.csv":  # as of an older version
        (folder / "clauses.csv").unlink()
    elif damage == "csv too short":
        progress.write_text("".join(progress.read_text().splitlines(keepends=True)[:2]))
    else:
        progress.unlink()
    train(run, folder, lambda _: None)
    assert files(folder) == files(tmp_path / "undisturbed")


def forge(checkpoint):
    """Turns the sign of every array of the learner's state, in a file that is whole."""
    arrays = read_arrays(checkpoint)
    write_arrays(checkpoint, **{name: -a if name.startswith("state.") else a for name, a in arrays.items()})


def files(folder):
    return {name: (folder / name).read_bytes() for name in ("progress.csv", "clauses.csv", "policy.npz", "done.json")}


@pytest.mark.parametrize("case", ["tltl_episodic", "continuous_step"])
@pytest.mark.parametrize("what", ["whole", "killed before it went on", "no last state", "forged", "other rows"])
def test_given_more_iterations_a_finished_run_goes_on_to_the_same_bytes(cases, tmp_path, monkeypatch, case, what):
    run = cases[case]
    shorter = replace(run, algorithm=replace(run.algorithm, iterations=4))
    train(run, tmp_path / "whole", lambda _: None)
    folder, done = tmp_path / "grown", []
    train(shorter, folder, lambda _: None)
    assert session.shorter_run(run, folder) == shorter
    assert session.shorter_run(shorter, folder) is None
    if what == "killed before it went on":
        monkeypatch.setattr(session, "_train", lambda *_: None)
        train(run, folder, done.append)
        monkeypatch.undo()
    elif what == "no last state":  # as results of an older version
        (folder / "last.npz").unlink()
    elif what == "forged":
        forge(folder / "last.npz")
    elif what == "other rows":
        text = (folder / "progress.csv").read_text().replace("reach_avoid", "reach_avoit", 1)
        (folder / "progress.csv").write_text(text)
    train(run, folder, done.append)
    assert done == ([5, 6] if what in ("whole", "killed before it went on") else [1, 2, 3, 4, 5, 6])
    assert files(folder) == files(tmp_path / "whole")


def test_a_result_without_clauses_of_an_older_version_is_whole(cases, tmp_path):
    run, done = cases["tltl_episodic"], tmp_path / "done.json"
    train(run, tmp_path, lambda _: None)
    (tmp_path / "clauses.csv").write_text("")
    with pytest.raises(DamagedError, match="clauses"):
        read_results(tmp_path, run.identity())
    content = json.loads(done.read_text())
    del content["sha256"]["clauses.csv"]
    done.write_text(json.dumps(content))
    (tmp_path / "clauses.csv").unlink()
    assert read_results(tmp_path, run.identity())["iterations"] == 6


def test_clauses_are_those_of_the_sampled_trajectories(cases, tmp_path):
    run = cases["discrete_episodic"]
    train(run, tmp_path, lambda _: None)
    row = pd.read_csv(tmp_path / "clauses.csv").iloc[0]
    *_, signals = by_hand(run)
    goal, safe = run.spec.clauses(signals).values()
    why, robustness = run.spec.explain(signals), run.spec.robustness(signals)
    over_time = run.spec.definitions_over_time(signals)
    expected = {
        "clause mean: F G at_goal": goal.mean(),
        "clause best: G safe": safe.max(),
        "clause met: G safe": np.mean(safe > 0),
        "clause decides: F G at_goal": np.mean(goal == robustness),
        "name mean: at_goal": over_time["at_goal"].max(axis=1).mean(),
        "name met: safe": np.mean((over_time["safe"] > 0).any(axis=1)),
        "name kept: safe": np.mean((over_time["safe"] > 0).all(axis=1)),
        "name decides: safe": np.mean([each.name == "safe" for each in why]),
    }
    np.testing.assert_allclose(row[list(expected)].astype(float), list(expected.values()), rtol=1e-4)
    assert len(row) == 1 + 2 * 4 + 2 * 5


def test_a_finished_run_is_left_alone(cases, tmp_path):
    run = cases["tltl_episodic"]
    train(run, tmp_path, lambda _: None)
    called = []
    train(run, tmp_path, called.append)
    assert called == []


def test_done_counts_the_successful_trials(cases, tmp_path):
    train(cases["tltl_episodic"], tmp_path, lambda _: None)
    done = json.loads((tmp_path / "done.json").read_text())
    assert done["trials"] == 4
    run, policy = cases["tltl_episodic"], learned_policy(tmp_path)
    rng = np.random.default_rng([run.seed, run.algorithm.iterations, run.trials])
    assert done["successes"] == np.sum(try_policy(run, policy, 4, rng).robustness > 0)
    assert done["satisfied"] == (done["robustness_policy"] > 0)


@pytest.mark.parametrize("rule", ["damped", "published"])
def test_reach_avoid_is_learned_in_short(rule, tmp_path):
    """From far below zero to near the goal within few iterations; the full budget is make reproduce-figures'."""
    run = runs("task.steps=200", "algorithm.iterations=18", "algorithm.samples=20", f"algorithm.covariance={rule}",
               "algorithm.epsilon=1.0")["tltl_episodic"]  # fmt: skip
    train(run, tmp_path, lambda _: None)
    rows = (tmp_path / "progress.csv").read_text().splitlines()
    first, last = (dict(zip(rows[0].split(","), rows[i].split(","), strict=True)) for i in (1, -1))
    assert float(first["robustness_mean"]) < -1.5
    assert float(last["robustness_mean"]) > -0.6


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"iterations": 0}, "algorithm.iterations: 0 is too small; it must be at least 1"),
        ({"iterations": 2.5}, "algorithm.iterations: expected a whole number, not 2.5"),
        ({"iterations": True}, "algorithm.iterations: expected a whole number, not True"),
        ({"samples": 1}, "algorithm.samples: 1 is too small; it must be at least 2"),
        ({"initial_std": 0.0}, "algorithm.initial_std: 0.0 is too small; it must be above 0"),
        ({"feedback": 1e7}, "algorithm.feedback: 10000000.0 is too large; it must be at most 1000000.0"),
        ({"correlation": float("inf")}, "algorithm.correlation: inf is not a finite number"),
    ],
)
def test_a_wrong_budget_is_refused_wherever_it_is_made(values, message):
    with pytest.raises(UserError) as error:
        AlgorithmConfig(**values)
    assert str(error.value) == message


TWO_STAGES = (
    "cases=[tltl_episodic]", "algorithm.told=leximin", "algorithm.basis=5", "algorithm.batches=3",
    "algorithm.keep=best",
    "algorithm.refine={after: 3, basis: 0, feedback: -20, initial_std: 0.1, batches: 2}",
)  # fmt: skip


@pytest.mark.parametrize("stop_at", [2, 3, 4])
def test_stopped_in_either_stage_or_between_them_it_ends_with_the_same_bytes(tmp_path, monkeypatch, stop_at):
    run = runs(*TWO_STAGES)["tltl_episodic"]
    train(run, tmp_path / "undisturbed", lambda _: None)
    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", 0.0)

    def stop(iteration):
        if iteration == stop_at + 1:
            raise Stop

    with pytest.raises(Stop):
        train(run, tmp_path / "stopped", stop)
    first = []
    train(run, tmp_path / "stopped", first.append)
    assert first[0] == stop_at + 1
    for name in ("progress.csv", "clauses.csv", "policy.npz", "done.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "undisturbed" / name).read_bytes(), name


def test_the_second_stage_explores_about_the_motion_that_the_first_one_learned(cases):
    """With another feedback: other offsets, the same motion."""
    setup, policy, _, _ = by_hand(cases["tltl_episodic"])
    policy = replace(policy, mean=policy.mean + np.random.default_rng(0).normal(0, 1.5, policy.mean.shape))
    again = AlgorithmConfig(feedback=-20.0, initial_std=0.1, correlation=3.0)
    refined = refined_policy(setup.task, setup.simulator, policy, again)
    before, after = (mean_motion(setup.simulator, p) for p in (policy, refined))
    np.testing.assert_allclose(after.features, before.features, atol=1e-9)
    assert np.abs(before.commands).max() > 2.0  # the first one asked for more than the actuators can do
    assert np.abs(after.commands).max() <= 2.0 + 1e-9
    assert np.sqrt(refined.covariance[7, 1, 1]) == pytest.approx(0.1 * 2.0)
    assert (refined.correlation, refined.gain[0, 0]) == (3.0, -20.0)


def test_leximin_is_told_to_the_learner_alone(cases):
    told = runs("cases=[tltl_episodic]", "algorithm.told=leximin")["tltl_episodic"]
    setup, policy, _, signals = by_hand(told)
    record = iterate(told, setup, setup.learner.start(policy), 0).record
    exact = iterate(cases["tltl_episodic"], setup, setup.learner.start(policy), 0).record
    conjuncts = told.spec.conjuncts(signals)
    np.testing.assert_array_equal(conjuncts.min(axis=1), told.spec.robustness(signals))
    np.testing.assert_allclose(record["return_mean"], leximin(conjuncts).mean(), atol=1e-12)
    for name in ("robustness_mean", "robustness_policy", "satisfied_fraction"):
        assert record[name] == exact[name]


def test_exploration_is_set_for_each_group_of_commands():
    task = set_up(runs("cases=[tltl_episodic]")["tltl_episodic"]).task
    policy = first_policy(task, AlgorithmConfig(exploration={"speeds": 0.25}))
    np.testing.assert_allclose(policy.covariance, np.tile(np.eye(3) * 0.5**2, (task.steps, 1, 1)))
    with pytest.raises(UserError, match=r"algorithm\.exploration\.speed: reach_avoid has no .*did you mean speeds"):
        first_policy(task, AlgorithmConfig(exploration={"speed": 0.25}))


def test_the_best_mean_policy_may_be_kept(tmp_path):
    run = runs("cases=[tltl_episodic]", "algorithm.keep=best", "algorithm.initial_std=2")["tltl_episodic"]
    train(run, tmp_path, lambda _: None)
    rows = pd.read_csv(tmp_path / "progress.csv")
    np.testing.assert_array_equal(rows.robustness_kept, rows.robustness_policy.cummax())
    kept = json.loads((tmp_path / "done.json").read_text())["robustness_policy"]
    assert kept >= rows.robustness_policy.max()


@pytest.mark.parametrize(
    ("refine", "message"),
    [
        ("{after: 3, samples: 9}", r"algorithm\.refine\.samples: it is the same in both stages"),
        ("{after: 3, policy: mine}", r"algorithm\.refine\.policy: it is the same in both stages"),
        ("{initial_std: 0.1}", r"algorithm\.refine\.after: expected the iterations of the first stage"),
        ("{after: 0}", r"algorithm\.refine\.after: .* not 0"),
        ("{after: 3, kept: 5}", r"algorithm\.refine\.kept: 5\.0 is too large"),
        ("{after: 3, initial_std: -1}", r"algorithm\.refine\.initial_std: -1\.0 is too small"),
        ("{after: 3, covariance: full}", r"algorithm\.refine\.covariance: there is no full"),
        ("{after: 3, epsilon: 9}", r"algorithm\.refine\.epsilon: 9\.0 must lie between"),
        ("{after: 3, exploration: {wrist: 1}}", r"algorithm\.refine\.exploration\.wrist: reach_avoid has no such"),
        ("{after: 3, initial_sdt: 1}", r"algorithm\.refine\.initial_sdt: no such key; did you mean"),
    ],
)
def test_mistakes_in_the_second_stage_are_told_before_anything_runs(refine, message):
    with pytest.raises(UserError, match=message):
        runs(f"algorithm.refine={refine}")


def test_basis_functions_do_not_go_with_rewards_of_single_steps():
    with pytest.raises(UserError, match=r"algorithm\.basis: continuous_step learns from the rewards of single steps"):
        runs("cases=[continuous_step]", "algorithm.basis=5")


def test_a_learned_motion_is_made_calm_and_stopped_on_the_way_comes_to_the_same_bytes(tmp_path, monkeypatch):
    """The learned policy stays as it is; the calm one is of its own and keeps the feedback."""
    options = ("cases=[tltl_episodic]", "spec=" + str(write_spec(tmp_path)))
    plain = runs(*options)["tltl_episodic"]
    run = runs(*options, "algorithm.calm=4")["tltl_episodic"]
    train(plain, tmp_path / "plain", lambda _: None)
    train(run, tmp_path / "undisturbed", lambda _: None)
    learned, calm = (learned_policy(tmp_path / "undisturbed", name) for name in ("policy.npz", "calm.npz"))
    assert not (tmp_path / "plain" / "calm.npz").exists()
    assert (tmp_path / "plain" / "policy.npz").read_bytes() == (tmp_path / "undisturbed" / "policy.npz").read_bytes()
    np.testing.assert_array_equal(calm.gain, learned.gain)
    assert not calm.covariance.any()
    done = json.loads((tmp_path / "undisturbed" / "done.json").read_text())
    assert done["satisfied"]
    assert done["calm"]["robustness_policy"] >= 0.7 * done["robustness_policy"]
    assert done["calm"]["motion"]["acceleration_rms"] < 0.5 * done["motion"]["acceleration_rms"]
    assert done["calm"]["batches"] == 4
    assert done["calm"]["episodes"] >= 4 * 20

    monkeypatch.setattr(session, "CHECKPOINT_SECONDS", 0.0)

    def stop_in_the_third(run, setup, policy, calm, least, straight):
        if calm.batches == 2:
            raise Stop
        return calmer(run, setup, policy, calm, least, straight)

    monkeypatch.setattr(calm_module, "calmer", stop_in_the_third)
    with pytest.raises(Stop):
        train(run, tmp_path / "stopped", lambda _: None)
    assert not (tmp_path / "stopped" / "done.json").exists()
    begun = []

    def noted(run, setup, policy, calm, least, straight):
        begun.append(calm.batches)
        return calmer(run, setup, policy, calm, least, straight)

    monkeypatch.setattr(calm_module, "calmer", noted)
    train(run, tmp_path / "stopped", lambda _: None)
    assert begun == [2, 3]  # it went on from its own checkpoint
    for name in ("progress.csv", "policy.npz", "calm.npz", "done.json"):
        assert (tmp_path / "stopped" / name).read_bytes() == (tmp_path / "undisturbed" / name).read_bytes(), name
    assert not list((tmp_path / "stopped").glob("*checkpoint*"))


def write_spec(folder):
    path = folder / "away.tltl"
    path.write_text("signal ee[2]\nspec: G ee.x > -10\n")
    return path


@pytest.mark.parametrize("unit", [1e-3, 40.0, 1e3])
def test_with_normalised_predicates_the_unit_of_one_leaves_the_learned_policy_the_same(tmp_path, unit):
    text = "signal ee[2]\nconst c = 1\nspec: F c * distance(ee, (1.5, 1)) < c * 0.2 & G ee.y > 0.1\n"
    means = []
    for c in (1.0, unit):
        (tmp_path / "task.tltl").write_text(text)
        overrides = (f"spec={tmp_path / 'task.tltl'}", f"+constants.c={c}", "algorithm.normalise=true")
        run = runs("cases=[tltl_episodic]", *overrides)["tltl_episodic"]
        train(run, tmp_path / str(c), lambda _: None)
        means.append(learned_policy(tmp_path / str(c)).mean)
        assert json.loads((tmp_path / str(c) / "done.json").read_text())["robustness_policy"] < 0  # in its own units
    np.testing.assert_allclose(means[1], means[0], atol=1e-6)


def test_learning_starts_from_a_policy_that_was_learned(cases, tmp_path):
    """About its mean motion, wherever its file lies; what it says counts."""
    run = cases["tltl_episodic"]
    train(run, tmp_path / "first", lambda _: None)
    train(run, tmp_path / "moved", lambda _: None)
    onward = runs(f"++algorithm.policy={tmp_path}/first", "algorithm.iterations=1", "cases=[tltl_episodic]")
    (again,) = onward.values()
    task = set_up(again).task
    started = first_policy(task, again.algorithm)
    motion = mean_motion(set_up(run).simulator, learned_policy(tmp_path / "first"))
    np.testing.assert_allclose(mean_motion(set_up(run).simulator, started).features, motion.features, atol=1e-9)
    np.testing.assert_array_equal(started.covariance, first_policy(task, run.algorithm).covariance)
    elsewhere = replace(again, algorithm=replace(again.algorithm, policy=f"{tmp_path}/moved/policy.npz"))
    assert (
        again.identity()
        == elsewhere.identity()
        != replace(again, algorithm=replace(again.algorithm, policy="")).identity()
    )
    of_another_task = "is a policy of 8 features, 3 commands and 30 steps; reach_avoid has"
    for policy, steps, message in (
        ("nix", 30, "cannot be read"), ("first/done.json", 30, "is no policy.npz"), ("first", 31, of_another_task),
    ):  # fmt: skip
        with pytest.raises(UserError, match=f"^algorithm.policy: .*{message}"):
            runs(f"++algorithm.policy={tmp_path}/{policy}", f"task.steps={steps}")


def test_results_of_another_edition_of_a_task_are_not_taken_for_its_own(cases):
    """The arm of 0.1 had the same settings, and moved otherwise."""
    run = cases["tltl_episodic"]

    class Before(type(run.task)):
        edition = 1

    before = replace(run, task=Before(**vars(run.task)))
    assert before.identity() != run.identity()


def test_results_of_another_edition_of_a_setting_are_not_taken_for_its_own(monkeypatch):
    """The same settings gave other results once; runs without them are not concerned."""
    texts = ["algorithm.told=robustness", "algorithm.told=leximin", "algorithm.calm=3"]
    asked = [["cases=[tltl_episodic]", text] for text in texts]
    before = [runs(*texts)["tltl_episodic"].identity() for texts in asked]
    monkeypatch.setattr("tltlrl.training.study.LEXIMIN_EDITION", 9)
    monkeypatch.setattr("tltlrl.training.study.CALM_EDITION", 9)
    after = [runs(*texts)["tltl_episodic"].identity() for texts in asked]
    assert [one == two for one, two in zip(before, after, strict=True)] == [True, False, False]


def test_leximin_does_not_go_with_learning_step_by_step():
    with pytest.raises(UserError, match=r"algorithm\.told: leximin .* learns step by step; expected robustness"):
        runs("cases=[tltl_step]", "algorithm.told=leximin")
    assert runs("cases=[tltl_step]", "algorithm.told=robustness")  # as it says
