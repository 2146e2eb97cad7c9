"""The picture of the plane, for any task that has a skeleton."""

from types import SimpleNamespace

import numpy as np

from tltlrl.learning.policy import Policy
from tltlrl.logic import parse_spec
from tltlrl.reports import workspace
from tltlrl.tasks.planar_arm.scene import PlanarArm, PlanarArmConfig


def test_a_task_needs_no_signal_of_a_certain_name(tmp_path, monkeypatch):
    task = PlanarArm(PlanarArmConfig(steps=10))
    task.signals = lambda features, _: {"turn": features[..., 0]}
    monkeypatch.setattr(workspace, "make_task", lambda _: task)
    run = SimpleNamespace(
        task=task.config,
        seed=0,
        algorithm=SimpleNamespace(iterations=1),
        spec=parse_spec("signal turn\nspec: G turn > 0"),
        case=SimpleNamespace(name="tltl_episodic"),
    )
    policy = Policy(np.zeros((3, 8)), np.zeros((10, 3)), np.tile(np.eye(3), (10, 1, 1)))
    workspace.draw_workspace(run, policy, tmp_path / "workspace", count=2)
    assert {path.suffix for path in tmp_path.iterdir()} == {".png", ".pdf"}
