"""tltl evaluate, render and plot on a small finished run, and on what is not one."""

import json
import re
import shlex
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import pandas as pd
import pytest
from sketched.sketch import sketch

from tltlrl.cli import main as cli
from tltlrl.cli.evaluate import check_command
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.experiment import run_experiment
from tltlrl.logic import load_spec
from tltlrl.reports import plotting
from tltlrl.resources import SPECS

RUN = "tltl_episodic/seed_0"


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    overrides = ["experiment=reach_avoid", "seeds=2", "cases=[tltl_episodic,continuous_step]", "trials=2", "workers=1"]
    settings = compose([*overrides, "task.steps=12", "algorithm.iterations=2", f"runs_dir={folder}"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plotting, "picture", sketch)
        assert run_experiment(*read(settings), ["test"])
    return folder / "reach_avoid"


def tltl(capsys, *arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    return ended.value.code, printed.out, printed.err


def test_evaluate_counts_its_trials_and_repeats_with_the_same_seed(experiment, capsys):
    code, first, _ = tltl(capsys, "evaluate", experiment / RUN, "--trials", 7, "--seed", 3)
    assert code == 0
    trials = re.findall(r"^trial (\d): robustness ([+-][\d.]+), (satisfied|violated)\b", first, flags=re.MULTILINE)
    assert [int(number) for number, _, _ in trials] == list(range(7))
    assert all((float(value) > 0) == (verdict == "satisfied") for _, value, verdict in trials)
    satisfied = sum(verdict == "satisfied" for _, _, verdict in trials)
    assert re.search(r"^  path_length +[\d.]+  m, of the end-effector$", first, flags=re.MULTILINE)
    assert f"success rate {satisfied}/7 = {satisfied / 7:.2f}" in first
    values = sorted(float(value) for _, value, _ in trials)
    said = "robustness: 5 % of the trials up to {:+.4f}, half up to {:+.4f}, 95 % up to {:+.4f}"
    assert f"\n{said.format(values[0], values[3], values[5])}\n" in first
    failures = re.findall(r"^(\d+) fail by `.+`.*, at steps? \d+", first, flags=re.MULTILINE)
    assert failures
    assert sum(map(int, failures)) == 7 - satisfied
    assert tltl(capsys, "evaluate", experiment / RUN, "--trials", 7, "--seed", 3)[1] == first
    assert tltl(capsys, "evaluate", experiment / RUN, "--trials", 7, "--seed", 4)[1] != first


def test_the_tables_say_how_every_case_moves(experiment):
    rows = pd.read_csv(experiment / "summary.csv")
    assert (rows[["path_length", "acceleration_rms", "jerk_peak", "command_rms"]] > 0).all(axis=None)
    assert rows["commands_at_limit"].between(0, 1).all()
    assert rows["time_to_satisfaction"].notna().eq(rows["satisfied"]).all()
    report = (experiment / "report.md").read_text()
    assert "| case | path length |" in report.split("## How the learned policies move")[1]


def test_plot_redraws_from_the_csv_alone_and_says_that_nothing_proves_it(experiment, tmp_path, capsys):
    shutil.copy(experiment / "learning_curves.csv", tmp_path)
    code, output, said = tltl(capsys, "plot", tmp_path, tmp_path, "--output", tmp_path / "both")
    assert code == 0
    assert output == f"{tmp_path}/both.png, {tmp_path}/both.pdf\n"
    assert f"{tmp_path}/learning_curves.csv is taken as it stands: the runs that would prove it are not there" in said
    assert (tmp_path / "both.png").stat().st_size > 0


def test_render_draws_the_workspace_and_the_motion_or_says_what_it_misses(experiment, tmp_path, capsys):
    code, _, errors = tltl(capsys, "render", experiment / RUN, "--output", tmp_path)
    assert (tmp_path / "workspace.png").stat().st_size > 0
    assert (tmp_path / "over_time.png").stat().st_size > 0
    if code == 0:
        assert (tmp_path / "motion.gif").read_bytes().startswith(b"GIF89a")
        assert (tmp_path / "motion.png").stat().st_size > 0
    else:
        assert code == 2
        assert "no picture can be rendered on this machine" in errors


def test_the_page_on_reading_results_names_commands_that_work(experiment, tmp_path, capsys, monkeypatch):
    page = (Path(__file__).parents[2] / "docs/reading.md").read_text()
    monkeypatch.chdir(tmp_path)
    runs = [line for line in page.splitlines() if line.startswith("tltl-run ")]
    for line in runs:
        settings = compose(shlex.split(line)[1:])
        shutil.copytree(experiment, tmp_path / "runs" / settings["name"])
        with open(tmp_path / "runs" / settings["name"] / "config.yaml", "a") as config:
            config.write(f"epsilon: {settings['algorithm']['epsilon']}\n")
    for command, said in (("plot", "continuous_step, "), ("export", "4 runs, 8 iterations")):
        (line,) = [line for line in page.splitlines() if line.startswith(f"tltl {command} ")]
        code, output, _ = tltl(capsys, *shlex.split(line)[1:])
        assert code == 0
        assert said in output
    assert (tmp_path / "runs/reading/comparison.png").exists()
    for name in re.findall(r"\]\(([^)#:]+)\)", page):
        assert (Path(__file__).parents[2] / "docs" / name).exists(), name


@pytest.mark.parametrize("command", ["evaluate", "render"])
@pytest.mark.parametrize("what", ["missing", "an experiment", "unfinished", "damaged policy", "damaged config"])
def test_what_is_not_a_finished_run_is_told(experiment, tmp_path, capsys, command, what):
    copy = tmp_path / "copy"
    shutil.copytree(experiment, copy)
    folder = copy / RUN
    if what == "missing":
        folder = tmp_path / "nothing" / "seed_0"
    elif what == "an experiment":
        folder = copy
    elif what == "unfinished":
        (folder / "done.json").unlink()
    elif what == "damaged policy":
        (folder / "policy.npz").write_bytes((folder / "policy.npz").read_bytes()[:200])
    else:
        (copy / "config.yaml").write_text("{")
    code, output, errors = tltl(capsys, command, folder)
    assert (code, output) == (2, "")
    assert errors.startswith(f"tltl: {folder} is not the folder of a finished run (")
    assert "Traceback" not in errors


def test_the_learned_motion_as_a_trace_that_check_explains(experiment, tmp_path, capsys):
    trace = tmp_path / "motion.csv"
    code, printed, _ = tltl(capsys, "evaluate", experiment / RUN, "--trace", trace, "--samples", 2, "--trials", 1)
    assert code == 0
    assert {path.name for path in tmp_path.iterdir()} == {"motion.csv", "motion_1.csv", "motion_2.csv"}
    lines = trace.read_text().splitlines()
    assert lines[0].startswith("time,ee.x,ee.y,angles.x")
    assert (len(lines), lines[-1].split(",")[0]) == (13, "0.55")
    done = json.loads((experiment / RUN / "done.json").read_text())
    command = shlex.split(printed.splitlines()[-1].removeprefix("explained by: "))
    for name in ("motion.csv", "motion_1.csv", "motion_2.csv"):
        (worth,) = re.findall(rf"{name}: .* motion, robustness (\S+)", printed)
        _, explained, _ = tltl(capsys, *[str(tmp_path / name) if a == str(trace) else a for a in command[1:]])
        assert f"robustness   {worth}" in explained
        if name == "motion.csv":
            assert worth == f"{done['robustness_policy']:+.6g}"
    code, _, errors = tltl(capsys, "evaluate", experiment / RUN, "--samples", 2)
    assert (code, errors) == (2, "tltl: --samples: say where to write them, as in --trace motion.csv\n")


@pytest.mark.usefixtures("without_pictures")
def test_a_calm_motion_is_a_trace_of_its_own(tmp_path, capsys):
    small = ("seeds=1", "trials=1", "task.steps=12", "algorithm.iterations=1", "constants.goal_radius=9", "workers=1")
    assert (
        cli.run(["experiment=reach_avoid", "cases=tltl_episodic", *small, "algorithm.calm=1", f"runs_dir={tmp_path}"])
        == 0
    )
    run = tmp_path / "reach_avoid" / RUN
    code, printed, _ = tltl(capsys, "evaluate", run, "--trace", tmp_path / "motion.csv", "--trials", 1)
    assert code == 0
    done = json.loads((run / "done.json").read_text())
    for name, of in (("motion.csv: the learned", done), ("motion_calm.csv: the calm", done["calm"])):
        assert f"{name} motion, robustness {of['robustness_policy']:+.6g}\n" in printed
    assert tltl(capsys, *shlex.split(printed.splitlines()[-1].removeprefix("explained by: "))[1:])[0] == 0
    assert "motion_calm.csv" in printed.splitlines()[-1]


def test_a_trace_is_checked_with_the_constants_that_were_learned_with(tmp_path):
    path = tmp_path / "my task.tltl"
    path.write_text("signal x\nconst a = 1\nconst b[r] = (1, 2)\nspec: F x > a + b[r].x\n")
    assert check_command(load_spec(path), Path("m.csv")) == f"tltl check '{path}' m.csv"
    other = load_spec(path, {"a": 3, "b": {"r": (4, 5)}})
    assert check_command(other, Path("m.csv")) == f"tltl check '{path}' m.csv --set a=3.0 --set 'b.r=[4.0, 5.0]'"


@pytest.mark.usefixtures("with_sketches")
@pytest.mark.parametrize("suffix", [".png", ".pdf", ".PNG"])
def test_a_suffix_is_not_doubled_and_said_as_it_is(experiment, tmp_path, capsys, suffix):
    code, output, _ = tltl(capsys, "plot", "--output", tmp_path / f"fig_3.3{suffix}", experiment)
    assert (code, output) == (0, f"{tmp_path}/fig_3.3.png, {tmp_path}/fig_3.3.pdf\n")
    assert {path.name for path in tmp_path.iterdir()} == {"fig_3.3.png", "fig_3.3.pdf"}


def test_a_picture_of_another_kind_is_refused(experiment, tmp_path, capsys):
    code, output, errors = tltl(capsys, "plot", experiment, "--output", tmp_path / "fig.svg")
    assert (code, output) == (2, "")
    assert errors == f"tltl: {tmp_path}/fig.svg: pictures are written as .png and .pdf; give the path without .svg\n"


@pytest.mark.parametrize("order", ["--trials 2 name=s experiment=nix", "name=s experiment=nix --trials 2"])
def test_options_of_a_search_stand_anywhere(capsys, order):
    code, _, errors = tltl(capsys, "search", *order.split())
    assert code == 2
    assert errors.startswith("tltl: say what to search")


def test_check_finds_the_specs_that_come_with_tltlrl(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, output, _ = tltl(capsys, "check", "reach_avoid.tltl")
    assert code == 0
    assert output.startswith(f"spec         {SPECS}/reach_avoid.tltl\n")


def test_plot_of_what_is_not_an_experiment_is_told(tmp_path, capsys):
    code, _, errors = tltl(capsys, "plot", tmp_path)
    assert code == 2
    assert errors.startswith(f"tltl: {tmp_path}/learning_curves.csv cannot be read (")


def test_evaluate_tries_a_policy_off_its_model(experiment, capsys):
    code, printed, _ = tltl(capsys, "evaluate", experiment / RUN, "--trials", 2, "--perturb", "mass=0.5:2,start=0.1")
    assert code == 0
    _, _, table = printed.partition("off the model, ")
    assert [line.split()[0] for line in table.splitlines()[2:]] == ["0.00", "0.25", "0.50", "0.75", "1.00"]
    code, _, errors = tltl(capsys, "evaluate", experiment / RUN, "--perturb", "mass=2")
    assert (code, errors) == (2, "tltl: --perturb mass=2: expected mass=0.8:1.2\n")


def test_what_diverges_off_the_model_is_a_failure_with_its_reason(experiment, capsys, monkeypatch):
    monkeypatch.setattr("tltlrl.cli.evaluate.try_off_model", lambda *_: (None, 2))
    code, printed, _ = tltl(capsys, "evaluate", experiment / RUN, "--trials", 2, "--perturb", "mass=0.5:2")
    assert code == 0
    last = re.sub(" +", " ", printed.splitlines()[-1])
    assert last == " 1.00 0/2 0.00 to 0.66 -inf -inf the simulation diverged (2)"


def test_a_warning_is_one_line_without_the_code_that_gave_it(monkeypatch, capsys):
    """Of a renderer that cannot be used, for instance."""

    def warns(*_):
        print(warnings.formatwarning("no\x1b egl", UserWarning, "module.py", 8, "warn()"), end="")
        return 0

    usual = warnings.formatwarning
    monkeypatch.setattr(cli, "mistakes_told", warns)
    assert tltl(capsys, "check") == (0, "tltl: no? egl\n", "")
    assert warnings.formatwarning is usual


def test_evaluate_refuses_nonsense(experiment, capsys):
    code, _, errors = tltl(capsys, "evaluate", experiment / RUN, "--trials", 0)
    assert (code, errors) == (2, "tltl: --trials must lie between 1 and 10000, and --seed be at least 0\n")


def test_a_policy_file_with_pickled_objects_is_refused(experiment, tmp_path, capsys):
    """Reading a run never runs code."""
    import numpy as np

    copy = tmp_path / "copy"
    shutil.copytree(experiment, copy)
    np.savez(copy / RUN / "policy.npz", gain=np.array([print], dtype=object), allow_pickle=True)
    code, _, errors = tltl(capsys, "evaluate", copy / RUN)
    assert code == 2
    assert "allow_pickle=False" in errors


def modules_of(*arguments):
    """What the command `tltl ARGUMENTS` has imported when it ends."""
    code = f"""
import sys
from tltlrl.cli.main import main
try:
    main({list(arguments)!r})
except SystemExit as ended:
    assert not ended.code
print(*sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    ("arguments", "without"),
    [
        (["--help"], {"numpy", "lark", "hydra", "importlib.metadata", "yaml"}),
        (["--version"], {"numpy", "lark", "hydra", "importlib.metadata", "yaml"}),
        (["check", str(SPECS / "reach_avoid.tltl")], {"mujoco", "dm_control", "hydra", "pandas", "matplotlib"}),
        (["check", "--help"], {"mujoco", "dm_control", "hydra", "pandas", "matplotlib"}),
        (["search", "--help"], {"mujoco", "dm_control", "pandas", "matplotlib", "optuna"}),
    ],
    ids=lambda words: " ".join(sorted(words)),  # a set has another order in every process
)  # fmt: skip
def test_a_command_imports_only_what_it_needs(arguments, without):
    assert not without & modules_of(*arguments)


def test_the_page_lists_every_command_and_each_has_its_own(capsys):
    code, page, _ = tltl(capsys, "--help")
    assert code == 0
    for name, about in cli.COMMANDS.items():
        assert re.search(rf"^    {name} +{re.escape(about[:30])}", page, flags=re.MULTILINE)
        code, own, _ = tltl(capsys, name, "--help")
        assert (code, own.split()[:3]) == (0, ["usage:", "tltl", name])


@pytest.mark.parametrize(
    ("arguments", "message"), [((), "tltl: say which command, one of:"), (("evalute",), "invalid choice")]
)
def test_what_is_no_command_is_told(capsys, arguments, message):
    code, _, errors = tltl(capsys, *arguments)
    assert code == 2
    assert message in errors
