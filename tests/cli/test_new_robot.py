"""A stranger's robot by the commands: new, tasks, a run, its trials, and what is told when its model was changed."""

import json
import re
import shlex
import shutil
from pathlib import Path

import forked
import pytest
import yaml

from tltlrl.cli import main as cli
from tltlrl.config.compose import compose
from tltlrl.config.read import read
from tltlrl.experiments.extend import changes
from tltlrl.training.build import set_up
from tltlrl.training.loop import iterate
from tltlrl.training.start import first_policy

EXAMPLES = Path(__file__).parents[2] / "examples"
MODEL = """\
<mujoco>
  <option timestep="0.02" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="turn" axis="0 0 1" damping="1"/>
      <geom type="capsule" fromto="0 0 0 1 0 0" size=".05"/>
      <site name="tip" pos="1 0 0"/>
    </body>
  </worldbody>
  <actuator><motor name="turn" joint="turn" gear="5" ctrlrange="-1 1"/></actuator>
</mujoco>
"""
BUDGET = ("seeds=1", "algorithm.iterations=2", "algorithm.samples=4", "trials=3", "workers=1", "task.duration=0.5")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(MODEL)
    return tmp_path


def tltl(*arguments):
    with pytest.raises(SystemExit) as ended:
        cli.main(list(arguments))
    return ended.value.code


@pytest.mark.usefixtures("with_sketches")
def test_from_a_model_to_trials(here, capsys):
    assert tltl("new", "arm.xml") == 0
    said = capsys.readouterr().out
    (command,) = [line.split() for line in said.splitlines() if line.startswith("  tltl-run ")]
    assert " ".join(command[1:]) == (
        "task=arm.yaml seeds=1 algorithm.iterations=40 algorithm.initial_std=0.3 algorithm.correlation=10"
    )
    assert tltl("new", "arm.xml") == 2
    assert "arm.yaml is there already" in capsys.readouterr().err
    assert tltl("tasks", "arm.yaml") == 0
    table = capsys.readouterr().out.splitlines()
    assert table[0] == "arm: 125 samples, one every 0.04 s, 5 s in all"
    assert table[3].startswith("  tip[3]           m              ")
    assert cli.run([*command[1:], *BUDGET]) == 0
    folder = here / "runs/arm"
    assert (folder / "learning_curves.png").exists()
    config = yaml.safe_load((folder / "config.yaml").read_text())
    assert config["task"]["name"] == "mjcf"
    assert config["task"]["file"] == str(here / "arm.yaml")
    capsys.readouterr()
    assert tltl("evaluate", "runs/arm/tltl_episodic/seed_0", "--trials", "3") == 0
    assert "success rate" in capsys.readouterr().out

    # The page may lie elsewhere, and is the same robot.
    (run,) = read(compose(["task=arm.yaml", *command[-2:], *BUDGET]))[0].runs()
    (here / "moved").mkdir()
    for name in ("arm.xml", "arm.yaml", "arm.tltl"):
        shutil.copy(here / name, here / "moved" / name)
    study, _ = read(compose(["task=moved/arm.yaml", *command[-2:], *BUDGET]))
    assert study.runs()[0].identity() == run.identity()
    assert not changes(config, study)

    # Another model is another robot.
    (here / "arm.xml").write_text(MODEL.replace('gear="5"', 'gear="6"'))
    assert cli.run(["task=arm.yaml", *command[-2:], *BUDGET]) == 2
    assert "holds results of another config:\n  task.digest: " in capsys.readouterr().err
    assert tltl("evaluate", "runs/arm/tltl_episodic/seed_0") == 2
    assert capsys.readouterr().err == (
        "tltl: arm.yaml:3: model: the model, or a file that it names, was changed since these results were made; "
        "put it back as it was, or train again under another name=...\n"
    )


@pytest.mark.usefixtures("with_sketches")
def test_a_robot_that_is_driven_by_speeds_is_shown_how_to_move_calmly(here, capsys):
    servo = '<velocity name="turn" joint="turn" kv="5" ctrlrange="-2 2"/>'
    (here / "arm.xml").write_text(re.sub("<motor.*?/>", servo, MODEL))
    assert tltl("new", "arm.xml") == 0
    (command,) = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("  tltl-run ")]
    assert command[-1] == "algorithm.calm=50"
    small = ("algorithm.iterations=8", "algorithm.samples=10", "algorithm.calm=5", "trials=3", "workers=1")
    assert cli.run([*command[1:], *small]) == 0
    results = json.loads((here / "runs/arm/tltl_episodic/seed_0/done.json").read_text())
    learned, calm = results["motion"], results["calm"]["motion"]
    assert calm["acceleration_rms"] < learned["acceleration_rms"]
    assert calm["path_length"] <= learned["path_length"]
    assert "| path length |" in (here / "runs/arm/report.md").read_text()


def test_the_first_spec_is_one_that_nothing_is_said_against(here, capsys):
    assert tltl("new", "arm.xml") == 0
    assert "spec: F[0 s, 4 s] G at_goal" in (here / "arm.tltl").read_text()
    capsys.readouterr()
    assert tltl("check", "arm.tltl") == 0
    assert "warning" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "tip"), [("finger", "site_xpos.touchbottom"), ("pendulum", "geom_xpos.mass"), ("reacher", "xpos.finger")]
)
@pytest.mark.usefixtures("here")
def test_a_first_page_speaks_of_what_moves_and_every_comment_on_it_is_a_line_that_works(name, tip):
    assert tltl("new", f"dm_control:suite/{name}.xml") == 0
    text = Path(f"{name}.yaml").read_text()
    page = yaml.safe_load(text)
    assert page["signals"]["tip"] == tip
    more = re.sub(r"^  # (?=\w+: (?:sensordata|site_xpos)\.)", "  ", text, flags=re.MULTILINE)
    assert more.count("\n  ") == len(yaml.safe_load(more)["signals"]) == text.count("\n  ")
    Path(f"{name}.yaml").write_text(more)
    assert tltl("tasks", f"{name}.yaml") == 0


@pytest.mark.usefixtures("here")
def test_a_first_goal_is_within_reach_of_what_learns():
    """Under the page's feedback, which keeps this robot near its start."""
    assert tltl("new", "dm_control:suite/finger.xml") == 0
    gently = ("algorithm.initial_std=0.3", "algorithm.correlation=10")
    (run,) = read(compose(["task=finger.yaml", "seeds=1", *gently]))[0].runs()
    setup = set_up(run)
    state = setup.learner.start(first_policy(setup.task, run.algorithm))
    for i in range(15):
        result = iterate(run, setup, state, i)
        state = result.state
    assert result.record["robustness_policy"] > 0


def test_what_new_says_of_actuators_names_the_model_and_works(here, capsys):
    servo = '<position name="turn" joint="turn" kp="5" kv="1" ctrlrange="-170 170"/>'
    degrees = re.sub("<motor.*?/>", servo, MODEL.replace('name="turn" axis', 'name="turn" range="-170 170" axis'))
    (here / "servo.xml").write_text(degrees)
    assert tltl("new", "servo.xml") == 2
    assert capsys.readouterr().err.startswith("tltl: servo.xml: the actuator turn sends its joint from -170 to 170 rad")
    assert not (here / "servo.yaml").exists()
    (here / "servo.xml").write_text(degrees.replace('ctrlrange="-170 170"', 'inheritrange="1"'))
    assert tltl("new", "servo.xml") == 0


def test_mistakes_of_the_commands(here, capsys):
    (here / "arm.yaml").write_text("model: arm.xml\ncontrol_timestep: 0.1\nsignals: {tip: site_xpos.tip}\n")
    (here / "mine.tltl").write_text("signal top[3]\nspec: F top.x > 0\n")
    for arguments, message in (
        (["task=arn.yaml"], "task=arn.yaml: there is no such file; give the page of a robot"),
        (["task=arm.yaml"], "spec: it has no value; give the .tltl file of what is to be learned"),
        (["task=arm.yaml", "spec=mine.tltl"], "spec: it needs a signal top, which arm has not"),
        (["task=arm.yaml", "experiment=toast"], "a robot's page needs no experiment; leave out experiment=toast"),
        (["task=arm.yaml", "spec=mine.tltl", "task.duration=-1"], "task.duration: -1.0 is too small"),
        (["task=arm.yaml", "spec=mine.tltl", "task.spred=1"], "task.spred: no such key; did you mean task.spread?"),
        (["task=mjcf"], "task=mjcf: there is no such task"),
    ):
        assert cli.run(arguments) == 2, arguments
        assert message in capsys.readouterr().err
    for arguments, message in (
        (["new", "arn.xml"], "arn.xml: there is no file arn.xml in .; did you mean arm.xml?"),
        (["new", "--task", "toats", "mine.tltl"], "no task is named toats; did you mean toast?"),
        (["new", "--task", "toast", "mine.txt"], "mine.txt: the file of a spec ends in .tltl"),
        (["new", "--task", "toast", "mine.tltl"], "mine.tltl is there already"),
        (["tasks", "toats"], "no task is named toats; did you mean toast?"),
        (["tasks", "mjcf"], "a robot is described by a page; give its file"),
    ):
        assert tltl(*arguments) == 2
        assert message in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_a_spec_to_begin_with_and_the_list_of_tasks(capsys):
    assert tltl("new", "--task", "reach_avoid", "mine.tltl") == 0
    assert tltl("check", "mine.tltl") == 0
    capsys.readouterr()
    assert tltl("tasks") == 0
    names = [line.split()[0] for line in capsys.readouterr().out.splitlines()]
    assert names == ["reach_avoid", "visit_in_order", "toast", "gymnasium", "suite", "FILE.yaml"]


@pytest.mark.parametrize(
    ("name", "signals"),
    [
        ("reacher", {"finger": 3}),
        ("jaco", {"wrist": 3, "elbow": 3, "flange": 3}),
        ("cartpole", {"cart": None, "speed": None, "spin": None, "pole": 3}),
    ],
)
def test_an_example_is_a_robot_and_its_spec_fits(name, signals):
    study, _ = read(compose([f"task={EXAMPLES / name / name}.yaml"]))
    assert study.name == name
    assert dict(study.spec.signals) == signals


PAGES_MODEL = """\
<mujoco>
  <option timestep="0.01" gravity="0 0 0"/>
  <worldbody>
    <camera name="front" pos="0 -3 0" xyaxes="1 0 0 0 0 1"/>
    <body>
      <joint name="shoulder" axis="0 0 1" damping="1"/>
      <geom type="capsule" fromto="0 0 0 1 0 0" size=".05"/>
      <body pos="1 0 0">
        <joint name="elbow" axis="0 0 1" damping="1"/>
        <geom type="capsule" fromto="0 0 0 1 0 0" size=".05"/>
        <site name="tip" pos="1 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder" gear="5" ctrlrange="-1 1"/>
    <motor name="elbow" joint="elbow" gear="5" ctrlrange="-1 1"/>
  </actuator>
  <keyframe><key name="home" qpos="0 0.5"/></keyframe>
</mujoco>
"""


def test_the_page_on_robots_as_written(tmp_path, monkeypatch, capsys):
    """docs/bring-your-robot.md: its commands in small, on a page that is the page's, and its message."""
    text = (EXAMPLES.parent / "docs/bring-your-robot.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.xml").write_text(PAGES_MODEL)
    shells = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    new, tasks, run, evaluate, _ = "".join(shells).splitlines()
    assert tltl(*shlex.split(new)[1:]) == 0
    (page,) = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (tmp_path / "arm.yaml").write_text(page.replace("site_xpos.tip", "site_xpos.tipp"))
    capsys.readouterr()
    assert tltl(*shlex.split(tasks)[1:]) == 2
    (said,) = re.findall(r"^    (arm\.yaml:10: .*)$", text, re.MULTILINE)
    assert said in capsys.readouterr().err
    (tmp_path / "arm.yaml").write_text(page)
    assert tltl(*shlex.split(tasks)[1:]) == 0
    for place in forked.PICTURES:
        monkeypatch.setattr(place, lambda *_, **__: None)
    assert cli.run([*shlex.split(run)[1:], *BUDGET]) == 0
    (perturbed,) = re.findall(r"^    (tltl evaluate .*)$", text, re.MULTILINE)
    for command in (evaluate, perturbed):
        assert tltl(*shlex.split(command.replace("--trials 100", "--trials 4"))[1:]) == 0
