"""Event files hold what the CSV files say, once each, also of runs that go on."""

import pytest

from tltlrl.errors import UserError
from tltlrl.reports.tensorboard import export, tag

pytest.importorskip("tensorboardX", reason="the export needs tensorboardX: pip install 'tltlrl[tensorboard]'")
HEAD = "task,case,seed,iteration,robustness_mean\n"


def run(folder, rows):
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(f"t,a,0,{i},{value}\n" for i, value in enumerate(rows))
    (folder / "progress.csv").write_text(f"{HEAD}{text}t,a,0,")
    (folder / "clauses.csv").write_text("iteration,clause decides: G safe\n0,0.25\n")


def scalars(folder):
    """tag => [(iteration, value)], read back from the records of the event files."""
    import struct

    from tensorboardX.proto.event_pb2 import Event

    found = {}
    for path in sorted(folder.glob("events*")):
        content = path.read_bytes()
        while content:
            (length,) = struct.unpack("<Q", content[:8])
            event = Event.FromString(content[12 : 12 + length])
            content = content[16 + length :]
            for value in event.summary.value:
                found.setdefault(value.tag, []).append((event.step, value.simple_value))
    return found


def test_every_row_is_there_once_also_if_runs_go_on(tmp_path):
    own = tmp_path / "x" / "a" / "seed_0"
    run(own, [-1.0])
    looks = []

    def wait(_):
        looks.append(1)
        run(own, [-1.0, "-inf", 0.5])
        (own / "done.json").write_text("{}")

    assert export(tmp_path / "x", tmp_path / "out", follow=True, wait=wait) == {own: 3}
    assert looks == [1]
    assert scalars(tmp_path / "out" / "a" / "seed_0") == {
        "robustness_mean": [(0, -1.0), (2, 0.5)],
        "clauses/clause_decides/G_safe": [(0, 0.25)],
    }
    with pytest.raises(UserError, match="is not empty"):
        export(tmp_path / "x", tmp_path / "out")


def test_without_runs_there_is_nothing_to_export(tmp_path):
    with pytest.raises(UserError, match="has no runs; give the folder of an experiment"):
        export(tmp_path, tmp_path / "out")


def test_tags_are_those_that_tensorboard_takes():
    assert tag("robustness_mean") == "robustness_mean"
    assert tag("clause mean: !(a | b) U c") == "clause_mean/not_a_or_b_U_c"
