"""Truncated linear temporal logic (TLTL) on batches of recorded trajectories.

    from tltlrl.logic import parse_spec
    spec = parse_spec("F G (x < 0.2)")
    spec.robustness({"x": [[0.9, 0.5, 0.1]]})  # array([0.1])

docs/spec-language.md describes the language. This package needs NumPy and lark, and nothing else of tltlrl.
"""

from tltlrl.logic.errors import SpecError, TraceError
from tltlrl.logic.explain import Explanation
from tltlrl.logic.meaning import Region
from tltlrl.logic.spec import Spec, is_signal_name, load_spec, parse_spec
from tltlrl.logic.telescope import telescope
from tltlrl.logic.traps import Trap

__all__ = [
    "Explanation",
    "Region",
    "Spec",
    "SpecError",
    "TraceError",
    "Trap",
    "is_signal_name",
    "load_spec",
    "parse_spec",
    "telescope",
]
