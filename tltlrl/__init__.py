"""Learn robot behaviour from truncated linear temporal logic (TLTL) specifications."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tltlrl.experiments.learn import learn
    from tltlrl.logic import SpecError, TraceError, load_spec, parse_spec
    from tltlrl.simulation.check_task import check_task
    from tltlrl.tasks.load import load_task

__version__ = "0.2.0"
__all__ = ["SpecError", "TraceError", "check_task", "learn", "load_spec", "load_task", "parse_spec"]

_HOMES = {
    "check_task": "tltlrl.simulation.check_task",
    "learn": "tltlrl.experiments.learn",
    "load_task": "tltlrl.tasks.load",
}


def __getattr__(name: str) -> Any:
    """Imports a public name on first use: a spec alone must not load MuJoCo, and a starting command not even NumPy."""
    if name in __all__:
        return getattr(importlib.import_module(_HOMES.get(name, "tltlrl.logic")), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
