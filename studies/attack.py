"""Attacks that have to fail: damaged files, forged files, commands killed while they write.

    python -m studies.attack --damages 200 --forged 60 --kills 50

After every attack, the commands that read the attacked files are run. The attack has failed if there was no
traceback, if no number changed without a message, and if the same command either wrote the bytes of an undisturbed
run, or refused and left everything as it was. `make attack` adds the kills of `tltl-run`
(tests/store/test_killed.py). Damages and kills are drawn with --seed. The forged files are a list, repeated until
there are enough.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from tqdm import tqdm

import tltlrl.cli.evaluate
import tltlrl.cli.plot  # noqa: F401  # so that the forked commands have them
from tltlrl.cli import main as cli
from tltlrl.experiments import experiment
from tltlrl.reports import plotting, report

SMALL = (
    "experiment=reach_avoid", "name=small", "seeds=2", "cases=[tltl_episodic]", "trials=2", "algorithm.iterations=2",
    "algorithm.samples=6", "algorithm.epsilon=0.5", "task.steps=12", "workers=1",
)  # fmt: skip
RUN = "small/tltl_episodic/seed_1"
OF_A_SESSION = (".lock", "timing.csv", "log.txt", "manifest.json", "report.html")
LAST = "last.npz"  # from where more iterations go on, which start again where it is lost or damaged
MORE = "algorithm.iterations=3"
PICTURES = (".png", ".pdf")
UNNOTICED = ("a bit", "a digit", "a sign")  # in a picture, of which no digest is kept
SECONDS = 600
MOST_SECONDS = 60  # of CPU
BOMB = "a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)


def command(folder: Path, *arguments: object, first: Callable[[], object] = lambda: None) -> tuple[int, str]:
    """Exit code (-N if signal N ended it) and everything that a command said, `tltl-run` or `tltl`, in a folder."""
    said = folder / "said.txt"
    pid = os.fork()
    if pid == 0:
        code = 3
        try:
            os.chdir(folder)
            sys.stdout.flush()
            descriptor = os.open(said, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
            os.dup2(descriptor, 1)
            os.dup2(descriptor, 2)
            sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w", buffering=1)
            signal.alarm(SECONDS)
            name, *rest = map(str, arguments)
            first()
            code = cli.run(rest) if name == "tltl-run" else cli.main([name, *rest])  # type: ignore[func-returns-value]
        except SystemExit as ended:
            code = int(ended.code or 0)
        except BaseException:
            import traceback

            traceback.print_exc()
        finally:
            sys.stdout.flush()
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return code, said.read_text(errors="replace")


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of an experiment whose bytes must not depend on who computed it, or when."""
    files = (path for path in sorted((folder / "small").rglob("*")) if path.is_file())
    return {
        str(path.relative_to(folder)): path.read_bytes() for path in files if path.name not in (*OF_A_SESSION, LAST)
    }


def wrong(code: int, said: str) -> str:
    """What no command may end with, whatever it was given."""
    if "Traceback" in said:
        return f"a traceback: {said.strip().splitlines()[-1]}"
    return "" if code in (0, 1, 2) else f"exit code {code}"


def damage(path: Path, rng: random.Random) -> str:
    """Damages a file; returns how, in a word."""
    content = path.read_bytes()
    digits = [i for i, byte in enumerate(content) if chr(byte).isdigit()]
    kind = rng.choice(["deleted", "emptied", "cut", "a bit", "a digit", "a sign", "deep", "noise", "twice"])
    if kind == "deleted":
        path.unlink()
        return kind
    if kind == "a bit" and content:
        changed = bytearray(content)
        changed[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        content = bytes(changed)
    elif kind == "a digit" and digits:
        place = rng.choice(digits)
        content = content[:place] + bytes([48 + (content[place] - 47) % 10]) + content[place + 1 :]
    elif kind == "a sign":
        content = content.replace(b"-", b"", 1)
    else:
        content = {
            "emptied": b"", "cut": content[: rng.randrange(len(content) or 1)], "deep": b"[" * 50_000,
            "noise": rng.randbytes(200), "twice": content * 2,
        }.get(kind, content)  # fmt: skip
    path.write_bytes(content)
    return kind


def damages(undisturbed: Path, count: int, rng: random.Random) -> Iterator[str]:
    """What went wrong, for every damaged file; empty where nothing did."""
    expected = contents(undisturbed)
    _, evaluated = command(undisturbed, "evaluate", RUN)
    files = [path.relative_to(undisturbed) for path in sorted((undisturbed / "small").rglob("*")) if path.is_file()]
    longer: dict[str, bytes] = {}
    if any(file.name == LAST for file in files[:count]):
        with tempfile.TemporaryDirectory() as name:
            command(Path(name), "tltl-run", *SMALL, MORE, "runs_dir=.")
            longer = contents(Path(name))
    order = [files[i % len(files)] for i in range(count)]
    for file in order:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            shutil.copytree(undisturbed / "small", folder / "small")
            kind = damage(folder / file, rng)
            found = []
            code, said = command(folder, "evaluate", RUN)
            found.append(wrong(code, said) or ("another evaluation" if code == 0 and said != evaluated else ""))
            code, said = command(folder, "plot", "small", "--output", "drawn", first=_without_pdf)
            found.append(wrong(code, said))
            if code == 0 and (folder / "drawn.png").read_bytes() != expected["small/learning_curves.png"]:
                found.append("another picture")
            before = contents(folder)
            drawing = file.suffix in (*PICTURES, ".html")  # most of the time, and of these files alone it is a test
            code, said = command(folder, "tltl-run", *SMALL, "runs_dir=.", first=str if drawing else _without_drawing)
            after, whole = contents(folder), dict(expected)
            found.append(wrong(code, said))
            if file.suffix in PICTURES and kind in UNNOTICED:
                whole[str(file)] = after[str(file)]
            if after != (whole if code == 0 else before):
                names = {name for name in after.keys() | whole.keys() if after.get(name) != whole.get(name)}
                found.append(f"exit code {code} and other bytes in {', '.join(sorted(names))}")
            if file.name == LAST:
                code, said = command(folder, "tltl-run", *SMALL, MORE, "runs_dir=.")
                found.append(wrong(code, said) or ("other bytes with more iterations" * (contents(folder) != longer)))
        yield "; ".join(f"{file} {kind}: {what}" for what in found if what)


def forged(undisturbed: Path, folder: Path, rng: random.Random) -> Iterator[tuple[str, list[object]]]:
    """Files of a stranger's, and the command that is given each."""
    manifest = json.loads((undisturbed / "small/manifest.json").read_text())

    def file(name: str, content: str | bytes) -> Path:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def policy(**arrays: object) -> bytes:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
        return buffer.getvalue()

    noise = rng.randbytes(300)
    deep = rng.choice(["[", "{", "("]) * rng.choice([500, 50_000])
    for key, value in {
        "config": None, "overwrite": True, "engine": {"address": "tcp://127.0.0.1:1"}, "runs_dir": "/proc",
        "name": "../../outside", "spec": "/etc/shadow", "cases": ["os_system"], "seeds": [1e300],
        "hydra": {"callbacks": {"a": {"_target_": "os.system"}}}, "trials": -1, "task": {"name": deep},
        "constants": {"goal": deep},
    }.items():  # fmt: skip
        changed = {k: v for k, v in manifest.items() if k != "sha256"}
        changed["config"] = value if key == "config" else {**manifest["config"], key: value}
        yield f"manifest {key}", ["tltl-run", "--from", file(f"m/{key}/manifest.json", json.dumps(changed))]
    for name, content in (("deep", deep), ("noise", noise), ("empty", b""), ("list", "[1]"), ("null", "null")):
        yield f"manifest {name}", ["tltl-run", "--from", file(f"m/{name}/manifest.json", content)]
    for name, content in {
        "bomb": BOMB, "deep": deep[:600], "itself": "a: &a [*a]\n", "tag": "!!python/object/apply:os.system ['id']\n",
        "noise": noise, "escape": "model: \x1b[31m.xml\n", "outside": "model: /etc/passwd\n", "empty": "",
    }.items():  # fmt: skip
        yield f"page {name}", ["tltl-run", f"task={file(f'{name}.yaml', content)}", "spec=reach_avoid.tltl"]
        head = b"# @package _global_\n"
        body = content if isinstance(content, bytes) else content.encode()
        file(f"own_{name}/experiment/{name}.yaml", head + body)
        yield f"experiment {name}", ["tltl-run", "--config-dir", folder / f"own_{name}", f"experiment={name}"]
    for name, content in {
        "deep": "G (" + "(" * rng.choice([100, 20_000]), "noise": noise, "null": "G (x < 1)\0", "empty": "",
        "huge window": "signal x\nspec: F[0,99999999999] (x > 0)\n", "escape": "\x1b[2J G (x < 1)",
        "power": "signal x\nspec: G (x < 9**9**9**9)\n", "code": "signal x\nspec: __import__('os').system('id')\n",
    }.items():  # fmt: skip
        spec = file(f"{name}.tltl", content)
        yield f"spec {name}", ["check", spec]
        yield f"spec {name} trained", ["tltl-run", *SMALL, f"spec={spec}", "runs_dir=trained"]
    trace = {"escape": "x\x1b[31m\n1\n", "noise": noise, "empty": "", "nan": "x\nnan\n", "words": "x\nhello\n"}
    spec = file("plain.tltl", "G (x < 1)")
    for name, content in trace.items():
        yield f"trace {name}", ["check", spec, file(f"{name}.csv", content)]
    good = {"gain": np.zeros((3, 8)), "mean": np.zeros((12, 3)), "covariance": np.ones((12, 3, 3)), "correlation": 1.0}
    objects = np.array([{}], dtype=object)
    bomb = io.BytesIO()
    with (
        zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("mean.npy", "w", force_zip64=True) as f,
    ):
        header = io.BytesIO()
        np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (2**31, 1)})
        f.write(header.getvalue() + b"\0" * 2**24)
    for name, content in {
        "objects": policy(**good | {"mean": objects}), "nan": policy(**good | {"mean": np.full((12, 3), np.nan)}),
        "shape": policy(**good | {"mean": np.zeros((5, 3))}), "noise": noise, "bomb": bomb.getvalue(),
        "text": policy(mean=np.array("a")), "empty": b"",
    }.items():  # fmt: skip
        start = file(f"p/{name}.npz", content)
        yield f"policy {name}", ["tltl-run", *SMALL, f"policy={start}", "runs_dir=started", f"name={name}"]


def forgeries(undisturbed: Path, count: int, rng: random.Random) -> Iterator[str]:
    """What went wrong, for every forged file."""
    done = 0
    while done < count:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "victim.txt").write_text("mine")
            for what, arguments in forged(undisturbed, folder, rng):
                start = _children_seconds()
                code, said = command(folder, *arguments)
                found = [wrong(code, said)]
                if "\x1b" in said or "\x07" in said:
                    found.append("a control character on the terminal")
                if code == 2 and len(said.splitlines()) > 12:
                    found.append(f"{len(said.splitlines())} lines")
                if (took := _children_seconds() - start) > MOST_SECONDS:
                    found.append(f"{took:.0f} s")
                if (folder / "victim.txt").read_text() != "mine":
                    found.append("a file of somebody else's changed")
                yield "; ".join(f"{what}: {one}" for one in found if one)
                done += 1
                if done == count:
                    return


def kills(undisturbed: Path, count: int, rng: random.Random) -> Iterator[str]:
    """The other commands that write, killed at a moment drawn from as long as each takes."""
    writing: dict[str, list[object]] = {
        "plot": ["plot", "small"],
        "evaluate": ["evaluate", RUN, "--trace", "motion.csv"],
        "search": ["search", *SMALL, "name=searched", "reward.c2=0,0.1", "--trials", 2],
        "new": ["new", "--task", "reach_avoid", "mine.tltl"],
    }
    took: dict[str, float] = {}
    expected: dict[str, dict[str, bytes]] = {}
    for i in range(count):
        name = list(writing)[i % len(writing)]
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            shutil.copytree(undisturbed / "small", folder / "small")
            if name not in took:
                start = time.monotonic()
                command(folder, *writing[name])
                took[name] = time.monotonic() - start
                expected[name] = _all(folder)
                for path in folder.rglob("*"):
                    if path.is_dir() and path.name == "runs":
                        shutil.rmtree(path)
            wait = rng.uniform(0, took[name])
            code, _ = command(folder, *writing[name], first=lambda wait=wait: _die_in(wait))  # type: ignore[misc]
            left = _all(folder)
            broken = [path for path, content in left.items() if expected[name].get(path, content) != content]
            again, said = command(folder, *writing[name])
            found = [wrong(again, said)]
            if code == -signal.SIGKILL and [path for path in broken if not path.startswith("runs/")]:
                found.append(f"left a part of {', '.join(broken)}")
            if again == 0 and _all(folder) != expected[name]:
                found.append("came to other bytes")
        yield "; ".join(f"{name} killed after {wait:.2f} s: {one}" for one in found if one)


def _children_seconds() -> float:
    """CPU time of the commands that have ended: what waits for other jobs of the machine is no fault."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _without_pdf() -> None:
    plotting.FORMATS.pop(".pdf")


def _without_drawing() -> None:
    report.plot_learning_curves = report.plot_clauses = lambda *_, **__: None
    experiment.write_page = experiment.draw_workspace = lambda *_, **__: None


def _die_in(seconds: float) -> None:
    signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.SIGKILL))
    signal.setitimer(signal.ITIMER_REAL, max(seconds, 0.01))


def _all(folder: Path) -> dict[str, bytes]:
    """Every file but those of a session, the journal, which has times in it, and what is half written."""
    skipped = (*OF_A_SESSION, "said.txt", "journal.log", "journal.log.lock")
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in files
        if path.name not in skipped and not path.name.startswith(".")
    }


def main(arguments: list[str]) -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m studies.attack", description="Attacks that have to fail.")
    for name, count in (("damages", 200), ("forged", 60), ("kills", 50), ("seed", 0)):
        parser.add_argument(f"--{name}", type=int, default=count)
    chosen = parser.parse_args(arguments)
    failed = 0
    with tempfile.TemporaryDirectory() as name:
        undisturbed = Path(name)
        code, said = command(undisturbed, "tltl-run", *SMALL, "runs_dir=.")
        assert code == 0, said
        for what, attack, count in (
            ("damaged files", damages, chosen.damages),
            ("forged files", forgeries, chosen.forged),
            ("commands killed", kills, chosen.kills),
        ):
            harm = 0
            answers = attack(undisturbed, count, random.Random(chosen.seed)) if count else iter(())
            for answer in tqdm(answers, total=count, desc=what, mininterval=10, disable=not count):
                if answer:
                    harm += 1
                    print(f"  {answer}", flush=True)
            failed += harm
            print(f"{what}: {count}, of which {harm} did harm", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
