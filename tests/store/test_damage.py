"""What happens to files after they were written: each damage is mended and told, or refused; never a wrong number."""

import errno
import json
import os
import resource
import shutil
import sys

import forked
import pytest

import tltlrl.experiments.experiment
import tltlrl.reports.report
import tltlrl.reports.video  # so that the forked processes have them
from tltlrl.cli import main as cli
from tltlrl.errors import UserError
from tltlrl.reports.sealed import read_curves, read_summary

SMALL = (
    "experiment=reach_avoid", "name=small", "seeds=2", "cases=[tltl_episodic]", "trials=2",
    "algorithm.iterations=2", "algorithm.samples=6", "algorithm.epsilon=0.5", "task.steps=12", "workers=1",
    "constants.goal_radius=9", "algorithm.calm=1",  # satisfied, so that there is a calm policy, too
)  # fmt: skip
RUN = "tltl_episodic/seed_1"


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    code, said = tltl_run(folder / "small", forked.with_sketches)
    assert code == 0, said
    return folder / "small"


@pytest.fixture
def copy(undisturbed, tmp_path):
    """A copy to be damaged."""
    return shutil.copytree(undisturbed, tmp_path / "small")


def result(folder):
    """The files and their bytes, without those of a session."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.name not in (".lock", "timing.csv")]
    own = ("log.txt", "manifest.json", "report.html")  # the page shows what the manifest says
    return {str(path.relative_to(folder)): None if path.name in own else path.read_bytes() for path in files}


def without_figure():
    """The figures of curves and the page are what takes most of the time."""
    forked.with_sketches()
    tltlrl.reports.report.plot_learning_curves = tltlrl.reports.report.plot_clauses = lambda *_: None
    tltlrl.experiments.experiment.write_page = lambda *_, **__: None


def tltl_run(folder, prepare=without_figure, *more):
    """Exit code and what was said; `prepare` is called first."""
    code, _, errors = forked.tltl_run(folder.parent, *SMALL, f"runs_dir={folder.parent}", *more, first=prepare)
    return code, errors


def tltl(capsys, *arguments):
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    return ended.value.code, printed.out, printed.err


def deleted(path):
    path.unlink()


def emptied(path):
    path.write_bytes(b"")


def cut(path):
    path.write_bytes(path.read_bytes()[:-20])


def without_last_row(path):
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:-1]))


def with_nan(path):
    path.write_text(replaced_in_last_row(path, "nan"))


def with_text(path):
    path.write_text(replaced_in_last_row(path, "fine"))


def with_other_digits(path):
    path.write_text(replaced_in_last_row(path, "0.125"))


def replaced_in_last_row(path, text):
    lines = path.read_text().splitlines()
    column = lines[0].split(",").index("robustness_mean")
    cells = lines[-1].split(",")
    return "\n".join([*lines[:-1], ",".join([*cells[:column], text, *cells[column + 1 :]])]) + "\n"


def a_byte_changed(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def fewer_successes(path):
    path.write_text(path.read_text().replace('"successes": 2', '"successes": 1'))


def of_another_seed(path):
    shutil.copytree(path.parent.with_name("seed_0"), path.parent, dirs_exist_ok=True)


def with_another_goal(path):
    path.write_text(path.read_text().replace("-1.2", "-1.3"))


def with_less_noise(path):
    path.write_text(path.read_text().replace("command_noise: 0.02", "command_noise: 0.01"))


def without_config(path):
    path.write_text(json.dumps(json.loads(path.read_text()) | {"config": None}))


def without_sessions(path):
    path.write_text(json.dumps(json.loads(path.read_text()) | {"later_sessions": None}))


SPEC = "specs/reach_avoid.tltl"
AGAIN = "the run is computed again"
RUN_DAMAGES = [
    (f"{RUN}/progress.csv", deleted, f"progress.csv is missing; {AGAIN}"),
    (f"{RUN}/clauses.csv", deleted, f"clauses.csv is missing; {AGAIN}"),
    (f"{RUN}/clauses.csv", cut, f"clauses.csv is not as it was written; {AGAIN}"),
    *(
        (f"{RUN}/progress.csv", damage, f"progress.csv is not as it was written; {AGAIN}")
        for damage in (emptied, cut, without_last_row, with_nan, with_text, with_other_digits)
    ),
    *((f"{RUN}/{name}", deleted, f"{name} is missing; {AGAIN}") for name in ("policy.npz", "calm.npz")),
    *(
        (f"{RUN}/{name}", damage, f"{name} is not as it was written; {AGAIN}")
        for name in ("policy.npz", "calm.npz")
        for damage in (emptied, cut, a_byte_changed)
    ),
    *(
        (f"{RUN}/done.json", damage, f"done.json is not as it was written; {AGAIN}")
        for damage in (emptied, cut, fewer_successes)
    ),
    (f"{RUN}/done.json", of_another_seed, f"done.json is of another config, spec, seed or version of tltlrl; {AGAIN}"),
]
RESTORED = "config.yaml was missing or damaged and is written again, from manifest.json"
DAMAGES = [
    *RUN_DAMAGES,
    (f"{RUN}/done.json", deleted, "1 run of 2 iterations into"),
    *((name, damage, "2 of 2 runs") for name in ("learning_curves.csv", "summary.csv") for damage in (deleted, cut)),
    *((name, emptied, "2 of 2 runs") for name in ("learning_curves.png", "tltl_episodic/workspace.png")),
    *(("config.yaml", damage, RESTORED) for damage in (deleted, emptied, cut)),
    *(
        (
            "manifest.json",
            damage,
            "manifest.json was missing or damaged: who computed the results kept here is no longer known",
        )
        for damage in (deleted, emptied, cut, without_config, without_sessions)
    ),
    *(
        (SPEC, damage, "specs/reach_avoid.tltl was missing or damaged and is written again")
        for damage in (deleted, emptied, cut, with_another_goal)
    ),
]


def named(damages):
    return {
        "argvalues": damages,
        "ids": [f"{path.rpartition('/')[2]} {damage.__name__}" for path, damage, _ in damages],
    }


@pytest.mark.parametrize(("name", "damage", "told"), **named(DAMAGES))
def test_the_same_command_mends_what_is_damaged_and_says_so(undisturbed, copy, name, damage, told):
    damage(copy / name)
    code, errors = tltl_run(copy, forked.with_sketches if name.endswith(".png") else without_figure)
    assert code == 0, errors
    assert told in errors
    assert ("of 2 iterations" in errors) == (AGAIN in told or "1 run of" in told)  # and computes nothing else
    assert result(copy) == result(undisturbed)


def test_config_and_manifest_both_lost_the_folder_is_left_alone(copy):
    for name in ("config.yaml", "manifest.json"):
        (copy / name).unlink()
    before = result(copy)
    code, errors = tltl_run(copy)
    assert code == 2
    assert "holds no results of tltl-run (its config.yaml is missing or not one of ours)" in errors
    assert result(copy) == before


def test_spec_and_manifest_both_lost_the_difference_is_told(copy):
    (copy / SPEC).unlink()
    (copy / "manifest.json").unlink()
    code, errors = tltl_run(copy)
    assert code == 2
    assert "or its copy was damaged or deleted. Set another name=..., or overwrite=true" in errors


@pytest.mark.parametrize("damage", [deleted, emptied, cut, without_config, without_sessions])
def test_a_damaged_manifest_cannot_be_repeated_and_that_is_told(copy, damage):
    damage(copy / "manifest.json")
    code, _, errors = forked.tltl_run(copy, "--from", copy / "manifest.json")
    assert code == 2
    assert f"tltl-run: {copy}/manifest.json: " in errors
    assert errors.endswith("the manifest.json of an experiment\n")
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize("garbage", [b"", b"PK\x03\x04 nothing", None])
def test_a_checkpoint_that_cannot_be_gone_on_from_is_told(undisturbed, copy, garbage):
    (copy / RUN / "done.json").unlink()
    content = garbage if garbage is not None else (copy / RUN / "policy.npz").read_bytes()
    (copy / RUN / "checkpoint.npz").write_bytes(content)
    code, errors = tltl_run(copy)
    assert code == 0
    assert f"{copy}/{RUN}: a run cannot be resumed from its checkpoint.npz (" in errors
    assert AGAIN in errors
    assert result(copy) == result(undisturbed)


@pytest.mark.parametrize(
    ("name", "damage", "told"),
    **named(
        [
            *RUN_DAMAGES,
            (f"{RUN}/done.json", deleted, ""),
            *(("config.yaml", damage, "") for damage in (deleted, emptied, cut, with_less_noise)),
            *((SPEC, damage, "") for damage in (deleted, emptied, cut, with_another_goal)),
        ]
    ),
)
def test_what_is_damaged_is_neither_evaluated_nor_rendered(copy, capsys, name, damage, told):
    damage(copy / name)
    for command in ("evaluate", "render"):
        code, output, errors = tltl(capsys, command, copy / RUN)
        assert (code, output) == (2, "")
        assert errors.startswith("tltl: ")
        assert told.partition(";")[0] in errors or "is not the folder of a finished run" in errors
        assert "Traceback" not in errors


ANOTHER = "is missing or not what its runs say"


@pytest.mark.parametrize("damage", [deleted, emptied, cut, without_last_row, with_nan, with_text, with_other_digits])
def test_learning_curves_are_those_of_the_runs_whatever_the_table_says(undisturbed, copy, damage):
    damage(copy / "learning_curves.csv")
    curves, notes = read_curves(copy)
    assert curves.equals(read_curves(undisturbed)[0])
    assert [note.partition(",")[0] for note in notes] == [f"{copy}/learning_curves.csv {ANOTHER}"]


@pytest.mark.usefixtures("with_sketches")
def test_what_is_drawn_in_place_of_a_damaged_table_is_told(copy, capsys):
    with_other_digits(copy / "learning_curves.csv")
    before = (copy / "learning_curves.png").read_bytes()
    code, output, errors = tltl(capsys, "plot", copy)
    assert (code, output) == (0, f"{copy}/learning_curves.png, {copy}/learning_curves.pdf\n")
    assert errors.startswith(f"tltl: {copy}/learning_curves.csv {ANOTHER}, so they are read in its place; ")
    assert (copy / "learning_curves.png").read_bytes() == before


@pytest.mark.parametrize(("name", "damage", "told"), **named(RUN_DAMAGES))
def test_curves_of_a_damaged_run_are_not_drawn(copy, name, damage, told):
    damage(copy / name)
    told = "progress.csv is of another case or seed;" if damage is of_another_seed else told
    with pytest.raises(UserError) as refused:
        read_curves(copy)
    assert str(refused.value).startswith(f"{copy / RUN}: {told.partition(';')[0]}; start its tltl-run again")


def test_a_damaged_summary_is_not_believed(copy):
    before, _ = read_summary(copy)
    path = copy / "summary.csv"
    path.write_text(path.read_text().replace("True", "False"))
    summary, notes = read_summary(copy)
    assert summary.equals(before)
    assert [note.partition(",")[0] for note in notes] == [f"{path} {ANOTHER}"]


@pytest.mark.parametrize("size", [10, 2500, 30_000])
def test_a_full_disk_is_told_and_the_same_command_goes_on(undisturbed, tmp_path, size):
    """The kernel refuses to write more than `size` bytes to a file: which is config, manifest, policy, figure."""

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
        forked.with_sketches()

    code, said = tltl_run(tmp_path / "small", limited)
    assert code == 2
    assert "Traceback" not in said
    last = said.splitlines()[-1]
    assert last.startswith(f"tltl-run: {tmp_path}/small/")
    assert last.endswith("check the disk or the folder, then start the command again: what is done is kept")
    code, errors = tltl_run(tmp_path / "small", forked.with_sketches)
    assert code == 0, errors
    assert result(tmp_path / "small") == result(undisturbed)


@pytest.mark.parametrize("command", ["tltl-run", "plot", "evaluate", "render"])
def test_a_read_only_folder_is_told(copy, command):
    def read_only():
        def refuse(event, arguments):
            if event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR) and str(copy) in str(arguments[0]):
                raise OSError(errno.EROFS, "Read-only file system", arguments[0])

        sys.addaudithook(refuse)

    before = result(copy)
    if command == "tltl-run":
        code, said = tltl_run(copy, read_only)
    else:
        code, _, said = forked.tltl(copy, command, copy if command == "plot" else copy / RUN, first=read_only)
    assert result(copy) == before
    if command == "evaluate":  # needs nothing written
        assert (code, said) == (0, "")
        return
    assert code == 2
    assert str(copy) in said
    assert "read-only file system" in said.lower()
    assert len(said.splitlines()) == 1


def test_if_no_run_finishes_nothing_of_earlier_ones_is_shown(copy):
    def failing():
        def iterate(*_):
            raise ValueError("no signal")

        tltlrl.training.session.iterate = iterate

    for seed in (0, 1):
        (copy / f"tltl_episodic/seed_{seed}/policy.npz").unlink()
    code, _ = tltl_run(copy, failing)
    assert code == 1
    assert not {"learning_curves.csv", "learning_curves.png", "learning_curves.pdf", "summary.csv", "report.md"} & {
        path.name for path in copy.iterdir()
    }
    page = (copy / "summary.md").read_text()
    assert "No run has finished." in page
    assert "- tltl_episodic/seed_1: ValueError: no signal" in page


@pytest.mark.parametrize("more", [(), ("overwrite=true",)])
def test_a_second_command_on_a_folder_is_refused_with_the_process_that_holds_it(copy, more):
    before = result(copy)
    with tltlrl.experiments.folder.working_in(copy):
        code, errors = tltl_run(copy, without_figure, *more)
    assert code == 2
    assert errors == (f"tltl-run: process {os.getpid()} is working in {copy}; wait for it, or set another name=...\n")
    assert result(copy) == before


def test_done_json_without_its_seal_is_computed_again(copy):
    before = (copy / RUN / "done.json").read_bytes()
    content = json.loads(before)
    del content["sha256"]
    (copy / RUN / "done.json").write_text(json.dumps(content))
    assert AGAIN in tltl_run(copy)[1]
    assert (copy / RUN / "done.json").read_bytes() == before
