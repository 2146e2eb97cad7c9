"""Learn robot behaviour from truncated linear temporal logic (TLTL) specifications."""

from tltlrl.spec import SpecError, TraceError, load_spec, parse_spec

__all__ = ["SpecError", "TraceError", "load_spec", "parse_spec"]
