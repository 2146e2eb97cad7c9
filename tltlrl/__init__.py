"""Learn robot behaviour from truncated linear temporal logic (TLTL) specifications."""

from typing import TYPE_CHECKING, Any

from tltlrl.spec import SpecError, TraceError, load_spec, parse_spec

if TYPE_CHECKING:
    from tltlrl.tasks import load_task

__all__ = ["SpecError", "TraceError", "load_spec", "load_task", "parse_spec"]


def __getattr__(name: str) -> Any:
    """`load_task` on first use: a spec alone must not load MuJoCo."""
    if name == "load_task":
        from tltlrl.tasks import load_task

        return load_task
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
