"""tltl search as its users meet it: the same trials however often it is stopped, and every mistake told."""

import copy
import csv
import functools
import json
import re
import shlex
import shutil
import sys
from pathlib import Path

import forked
import pytest
import yaml

from tltlrl.cli import main as cli
from tltlrl.config.compose import compose
from tltlrl.experiments import search

ROOT = Path(__file__).parents[2]
SMALL = (
    "experiment=reach_avoid", "name=small", "cases=[continuous_episodic]", "seeds=[100,101]", "task.steps=20",
    "algorithm.iterations=2", "algorithm.samples=6", "trials=2", "workers=1",
)  # fmt: skip
SPACE = ("reward.c2=interval(0,0.4)", "algorithm.covariance=choice(damped,published)")


@functools.cache
def composed(*overrides):
    return compose(overrides)


@pytest.fixture(autouse=True)
def plain(without_pictures, monkeypatch, tmp_path):  # noqa: ARG001  # no candidate needs one here
    """In an empty folder; what one test has composed, Hydra need not compose for the next."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tltlrl.cli.search.compose", lambda overrides: copy.deepcopy(composed(*overrides)))


def tltl_search(*arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main(["search", *map(str, arguments)])
    return ended.value.code


def tables(folder):
    return {name: (folder / name).read_bytes() for name in ("trials.csv", "summary.md", "search.yaml")}


def trials(folder):
    with open(folder / "trials.csv", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The folder of a search of three trials."""
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for place in forked.PICTURES:
            patch.setattr(place, lambda *_, **__: None)
        assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 0
    return folder / "runs" / "small"


def test_every_trial_is_an_experiment_and_the_objective_its_mean_robustness(undisturbed):
    rows = trials(undisturbed)
    assert list(rows[0]) == [
        "number", "reward.c2", "algorithm.covariance", "objective", "satisfied", "runs", "successes", "trials", "state",
    ]  # fmt: skip
    assert [row["number"] for row in rows] == ["0", "1", "2"]
    assert len({row["reward.c2"] for row in rows}) == 3
    for row in rows:
        folder = undisturbed / f"trial_{int(row['number']):03d}"
        config = yaml.safe_load((folder / "config.yaml").read_text())
        assert config["reward"]["c2"] == float(row["reward.c2"])
        assert 0 <= config["reward"]["c2"] <= 0.4
        assert config["algorithm"]["covariance"] == row["algorithm.covariance"]
        with open(folder / "summary.csv", newline="") as file:
            runs = list(csv.DictReader(file))
        assert [run["seed"] for run in runs] == ["100", "101"]
        assert float(row["objective"]) == sum(float(run["robustness_policy"]) for run in runs) / 2
        assert row["successes"] == str(sum(int(run["successes"]) for run in runs))
        assert (row["runs"], row["trials"], row["state"]) == ("2", "4", "COMPLETE")


def test_the_best_ones_command_has_the_experiments_own_budget(undisturbed):
    best = max(trials(undisturbed), key=lambda row: float(row["objective"]))
    page = (undisturbed / "summary.md").read_text()
    words = shlex.split(re.search(r"^    (tltl-run .*)$", page, flags=re.MULTILINE)[1])
    assert set(words[1:]) == {
        "experiment=reach_avoid", "name=small_best", "cases=[continuous_episodic]", "task.steps=20",
        "algorithm.samples=6", f"reward.c2={best['reward.c2']}", f"algorithm.covariance={best['algorithm.covariance']}",
    }  # fmt: skip


@pytest.mark.parametrize("moment", ["suggested", "running", "told", "between sessions"])
def test_a_stopped_search_goes_on_to_the_same_bytes(undisturbed, tmp_path, monkeypatch, capsys, moment):
    """Ctrl-C in the second trial: once it is in the journal, in the middle of its runs, before its result is told."""
    if moment == "between sessions":
        assert tltl_search(*SMALL, *SPACE, "--trials", 2) == 0
    else:
        import tltlrl.experiments.experiment

        begun = []

        def stopped(study, machinery, command):
            begun.append(study.name)
            if len(begun) < 2:
                return tltlrl.experiments.experiment.run_experiment(study, machinery, command)
            if moment == "told":
                tltlrl.experiments.experiment.run_experiment(study, machinery, command)
            elif moment == "running":
                shutil.copytree(undisturbed / "trial_001", "runs/small/trial_001")
                Path("runs/small/trial_001/continuous_episodic/seed_101/done.json").unlink()
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(search, "run_experiment", stopped)
            assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 130
        assert "stopped; the same command continues" in capsys.readouterr().err
        with open("runs/small/journal.log", "a") as journal:  # as a kill in the middle of writing leaves it
            journal.write('{"op_code": 6, "wor')
        Path("runs/small/journal.log.lock").symlink_to("journal.log")
    assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 0
    assert "of 3 candidates were done before and are kept" in capsys.readouterr().err
    assert tables(tmp_path / "runs/small") == tables(undisturbed)


def test_the_same_command_again_keeps_all_and_computes_what_was_deleted(undisturbed, tmp_path, monkeypatch, capsys):
    shutil.copytree(undisturbed, tmp_path / "runs/small")
    shutil.rmtree(tmp_path / "runs/small/trial_001")
    (tmp_path / "runs/small/trials.csv").unlink()
    assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 0
    assert re.findall(r"^candidate (\d+) \(", capsys.readouterr().err, flags=re.MULTILINE) == ["1"]
    assert tables(tmp_path / "runs/small") == tables(undisturbed)
    monkeypatch.setattr(search, "run_experiment", None)
    assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 0
    journal = [json.loads(line) for line in (tmp_path / "runs/small/journal.log").read_text().splitlines()]
    assert sum("state" in line for line in journal) == 2 * 3  # three trials begun and told, none twice


def test_a_candidate_is_worth_what_its_runs_say_and_not_the_journal_or_a_table(undisturbed, tmp_path, capsys):
    shutil.copytree(undisturbed, tmp_path / "runs/small")
    journal, folder = Path("runs/small/journal.log"), Path("runs/small/trial_001")
    value = float(trials(undisturbed)[1]["objective"])
    journal.write_text(journal.read_text().replace(f"[{value}]", f"[{-value}]"))
    (folder / "summary.csv").write_text((folder / "summary.csv").read_text().replace("-", ""))
    assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 0
    printed = capsys.readouterr()
    assert (
        f"candidate 1: robustness {-value:+.4f} by journal.log and {value:+.4f} by its runs, which count" in printed.err
    )
    assert "best: candidate" in printed.out
    assert tables(tmp_path / "runs/small") == tables(undisturbed)


def test_parameters_that_were_changed_in_the_journal_are_found_out(undisturbed, tmp_path, capsys):
    shutil.copytree(undisturbed, tmp_path / "runs/small")
    journal = Path("runs/small/journal.log")
    value = trials(undisturbed)[1]["reward.c2"]
    journal.write_text(journal.read_text().replace(value, "0.125"))
    assert tltl_search(*SMALL, *SPACE, "--trials", 3) == 2
    assert f"reward.c2: {value} there, 0.125 now" in capsys.readouterr().err


def test_a_folder_that_is_no_search_stays_as_it_is(tmp_path, capsys):
    Path("runs/small").mkdir(parents=True)
    Path("runs/small/notes.txt").write_text("mine")
    assert tltl_search(*SMALL, *SPACE, "overwrite=true") == 2
    assert "exists and holds no search" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "runs/small").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("changed", "difference"),
    [
        (("reward.c2=interval(0,0.5)",), "space.reward.c2: interval(0,0.4) there, interval(0,0.5) now"),
        (("reward.goal=3",), "reward.goal: 5.0 there, 3 now"),
        (("seeds=[100]",), "seeds: [100, 101] there, [100] now"),
        (("--seed", 1), "seed: 0 there, 1 now"),
    ],
)
def test_another_search_in_the_folder_is_refused_with_the_difference(
    undisturbed, tmp_path, capsys, changed, difference
):
    shutil.copytree(undisturbed, tmp_path / "runs/small")
    key = str(changed[0]).partition("=")[0]
    kept = [word for word in (*SMALL, *SPACE) if word.partition("=")[0] != key]
    assert tltl_search(*kept, *changed, "--trials", 3) == 2
    errors = capsys.readouterr().err
    assert "runs/small holds another search:\n" in errors
    assert f"  {difference}\n" in errors
    assert "overwrite=true" in errors
    assert tables(tmp_path / "runs/small") == tables(undisturbed)
    if key == "seeds":
        assert tltl_search(*kept, *changed, "overwrite=true", "--trials", 1) == 0
        assert len(trials(tmp_path / "runs/small")) == 1
        assert not (tmp_path / "runs/small/trial_001").exists()


def test_a_failed_trial_is_told_and_the_search_goes_on(tmp_path, monkeypatch, capsys):
    """Too few samples for epsilon = 1.5 make no experiment; a run that fails is of one that was possible."""
    from tltlrl.training import session

    iterate = session.iterate

    def failing(run, *rest):
        if run.algorithm.samples == 6:
            raise ValueError("a return is not a number")
        return iterate(run, *rest)

    monkeypatch.setattr(session, "iterate", failing)
    kept = [word for word in SMALL if not word.startswith("algorithm.samples")]
    space = ("algorithm.samples=range(4,9,2)", "algorithm.epsilon=interval(1.2,1.7)")
    assert tltl_search(*kept, *space, "--trials", 8, "--seed", 1) == 1
    rows = trials(tmp_path / "runs/small")
    impossible = {
        r["number"] for r in rows if r["algorithm.samples"] == "4" and float(r["algorithm.epsilon"]) >= 1.3863
    }
    broken = {r["number"] for r in rows if r["algorithm.samples"] == "6"}
    failed = {r["number"] for r in rows if r["state"] == "FAIL"}
    assert impossible
    assert broken
    assert failed == impossible | broken != {r["number"] for r in rows}
    page = (tmp_path / "runs/small/summary.md").read_text().partition("## Failed candidates")[2]
    assert page.count("must lie between 0 and log(algorithm.samples)") == len(impossible)
    assert page.count("log.txt") == len(broken)
    assert f"{len(failed)} of 8 candidates failed" in capsys.readouterr().out
    before = tables(tmp_path / "runs/small")
    assert tltl_search(*kept, *space, "--trials", 8, "--seed", 1) == 1
    assert tables(tmp_path / "runs/small") == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "say what to search, as in 'reward.c2=interval(0,0.4)'"),
        (("reward.c9=interval(0,1)",), "reward.c9: no such key; did you mean"),
        (("algorithm.covariance=damped,publishd",), "there is no publishd; did you mean published?"),
        (("algorithm.samples=interval(4,8)",), "algorithm.samples: "),
        (("seeds=choice(1,2)",), "seeds: it cannot be searched"),
        (("reward.c2=tag(log,interval(0,1))",), "reward.c2: tag(log,interval(0,1)) cannot be searched; there are"),
        (("reward.c2=interval(0,inf)",), "reward.c2: interval(0,inf) cannot be searched; there are"),
        (
            ("reward=null", "reward.c2=0.1,0.2"),
            "reward=null: there is no such reward; there are: gymnasium, reach_avoid",
        ),
        (("reward.c2=0.1,0.2", "--config-dir", "mine"), "--config-dir mine: there is no such folder"),
        (("reward.c2=interval(1,0)",), "reward.c2: interval(1,0) cannot be searched; there are"),
        (("reward.c2=interval(0,",), "not readable as key=value"),
        (("reward.c2=0.1,0.2", "--trials", 0), "--trials must lie between 1 and 1000"),
    ],
)
def test_mistakes_are_told_before_anything_is_written(tmp_path, capsys, arguments, message):
    assert tltl_search(*SMALL, *arguments) == 2
    errors = capsys.readouterr().err
    assert errors.startswith("tltl: ")
    assert message in errors
    assert len(errors.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("content", [None, b"\xff", b"name: small\n"])
def test_a_folder_that_holds_something_else_is_left_alone(tmp_path, capsys, content):
    (tmp_path / "runs/small").mkdir(parents=True)
    if content is not None:
        (tmp_path / "runs/small/search.yaml").write_bytes(content)
    (tmp_path / "runs/small/thesis.txt").write_text("mine")
    assert tltl_search(*SMALL, *SPACE, "overwrite=true") == 2
    assert "holds no search" in capsys.readouterr().err
    assert (tmp_path / "runs/small/thesis.txt").read_text() == "mine"


def test_without_optuna_it_says_how_to_install_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert tltl_search(*SMALL, *SPACE) == 2
    assert capsys.readouterr().err == "tltl: the search needs Optuna, an extra: pip install 'tltlrl[search]'\n"
    assert list(tmp_path.iterdir()) == []


def test_the_space_is_hydras_grammar():
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    written = {
        "a.f=interval(0,0.4)": FloatDistribution(0.0, 0.4),
        "a.l=tag(log,interval(0.1,10))": FloatDistribution(0.1, 10.0, log=True),
        "a.i=int(interval(2,8))": IntDistribution(2, 8),
        "a.r=range(10,50,10)": IntDistribution(10, 40, step=10),
        "a.s=range(0.5,2,0.5)": FloatDistribution(0.5, 1.5, step=0.5),
        "a.c=x,y": CategoricalDistribution(("x", "y")),
        "a.v=choice([1,2],[3])": CategoricalDistribution(("[1,2]", "[3]")),
    }
    fixed, space, distributions = search.parse_space(["b=1", *written])
    assert fixed == ["b=1"]
    assert list(space) == [text.partition("=")[0] for text in written]
    assert list(distributions.values()) == list(written.values())


def test_the_commands_of_the_page(tmp_path):
    """docs/search.md as written, but for a small budget, and in this process."""
    script = "\n".join(re.findall(r"^```sh\n(.*?)^```", (ROOT / "docs/search.md").read_text(), re.M | re.S))
    commands = [line for line in script.replace("\\\n", " ").splitlines() if line.startswith(("tltl ", "tltl-run "))]
    assert [command.split()[0] for command in commands] == ["tltl", "tltl-run"]
    small = "task.steps=20 trials=2 seeds=1 workers=1 algorithm.iterations=2"
    for command in commands:
        short = re.sub(
            r" --trials \d+|$", f" {small} --trials 2" if "search " in command else f" {small}", command, count=1
        )
        name, *words = shlex.split(short)
        if name == "tltl":
            assert words.pop(0) == "search"
            assert tltl_search(*words) == 0
        else:
            assert cli.run(words) == 0
    assert len(trials(tmp_path / "runs/c2_search")) == 2
    assert (tmp_path / "runs/c2_search_best/summary.csv").exists()
