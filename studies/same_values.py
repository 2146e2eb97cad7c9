"""Do two versions of tltlrl give specs the same values, to the byte?

    PYTHONPATH=OLD python studies/same_values.py specs > old
    PYTHONPATH=NEW python studies/same_values.py specs > new
    cmp old new

Printed is one digest for each of 10,000 random formulas of the first edition's language and for each spec of a folder:
of the robustness on batches of one length and of different lengths, of that over time, and of what decides. Random
formulas hold +, -, *, abs, min, max and norm alone, whose values are the same on every machine.
"""

from __future__ import annotations

import hashlib
import random
import sys
from pathlib import Path

import numpy as np

try:
    from tltlrl.logic import Spec, load_spec, parse_spec
except ImportError:  # version 0.1
    from tltlrl.spec import Spec, load_spec, parse_spec  # type: ignore[import-not-found, no-redef]

COUNT = 10_000
DECLARED = "signal x\nsignal y\nsignal z\nsignal p[2]\nspec: "


def formulas(count: int = COUNT) -> list[str]:
    """Random formulas of every operator of the first edition."""
    chance = random.Random(20261125)

    def amount(depth: int = 0) -> str:
        if depth > 1 or chance.random() < 0.5:
            return chance.choice("xyz")
        kind = chance.randrange(7)
        if kind == 0:
            return f"({amount(depth + 1)} {chance.choice('+*')} {chance.randint(0, 12) / 4})"
        if kind == 1:
            return f"({amount(depth + 1)} - {chance.randint(0, 12) / 4})"
        if kind == 2:
            return f"-{amount(depth + 1)}"
        if kind == 3:
            return f"abs({amount(depth + 1)})"
        if kind in (4, 5):
            return f"{chance.choice(['max', 'min'])}({amount(depth + 1)}, {amount(depth + 1)})"
        return f"norm(({amount(depth + 1)}, {amount(depth + 1)}))"

    def predicate() -> str:
        kind = chance.random()
        if kind < 0.1:
            return f"ball(p, ({chance.randint(-3, 3)}, 0.5), {chance.randint(1, 8) / 4})"
        if kind < 0.2:
            return f"box(p, ({chance.randint(-3, 0)}, -1), (1, {chance.randint(1, 8) / 4}))"
        if kind < 0.3:
            return f"{chance.randint(-8, 0) / 4} < {amount()} <= {amount()}"
        return f"{amount()} {chance.choice(['<', '>', '<=', '>='])} {chance.randint(-12, 12) / 4}"

    def window() -> str:
        if chance.random() < 0.4:
            return ""
        low = chance.randint(0, 4)
        return f"[{low}, {low + chance.randint(0, 6)}]"

    def formula(depth: int) -> str:
        if depth == 0 or chance.random() < 0.15:
            return f"({predicate()})"
        kind = chance.choice(["!", "&", "|", "=>", "<=>", "X", "X[!]", "G", "F", "U", "R", "W", "T"])
        if kind in {"!", "X", "X[!]"}:
            return f"{kind} {formula(depth - 1)}"
        if kind in {"G", "F"}:
            return f"{kind}{window()} {formula(depth - 1)}"
        between = kind + window() if kind in {"U", "R"} else kind
        return f"({formula(depth - 1)} {between} {formula(depth - 1)})"

    return [formula(chance.choice([1, 2, 2, 3, 3, 4])) for _ in range(count)]


def digest(spec: Spec, seed: int, count: int, steps: int) -> str:
    """SHA-256 of what a spec says of random trajectories."""
    generator = np.random.default_rng(seed)
    signals = {
        name: generator.integers(-12, 13, (count, steps, *([] if d is None else [d]))) / 4
        for name, d in spec.signals.items()
    }
    lengths = generator.integers(1, steps + 1, count)
    told = [
        (why.value, why.predicate, why.step, why.margin, why.negated, dict(why.definitions))
        for why in spec.explain(signals, lengths)
    ]
    values = (spec.robustness(signals), spec.robustness(signals, lengths), spec.robustness_over_time(signals, lengths))
    return hashlib.sha256(b"".join(v.tobytes() for v in values) + repr(told).encode()).hexdigest()


def main(arguments: list[str]) -> int:
    """The command line; returns the exit code."""
    if len(arguments) != 1 or not Path(arguments[0]).is_dir():
        print("give the folder of specs", file=sys.stderr)
        return 2
    for seed, text in enumerate(formulas()):
        generator = np.random.default_rng(seed)
        count, steps = int(generator.integers(1, 4)), int(generator.integers(1, 12))
        print(digest(parse_spec(DECLARED + text), seed, count, steps), text)
    for path in sorted(Path(arguments[0]).glob("*.tltl")):
        for count, steps in ((7, 100), (30, 200)):
            print(digest(load_spec(path), 1, count, steps), path.name)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
