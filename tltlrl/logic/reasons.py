"""Why trajectories fail: the predicates that decide their robustness, grouped and counted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from tltlrl.logic.explain import Explanation


@dataclass(frozen=True)
class Reason:
    """One cause of failure, and how often it occurs.

    Attributes:
      what: the predicate that decides, with the named sub-formula it stands in.
      count: number of trajectories that it decides.
      first, last: earliest and latest step at which it decides.
      worst, best: lowest and highest robustness among them.
    """

    what: str
    count: int
    first: int
    last: int
    worst: float
    best: float

    def told(self, timestep: float) -> str:
        """The reason in words; `timestep` is the time between two samples, s."""
        when = f"step {self.first}" if self.first == self.last else f"steps {self.first} to {self.last}"
        seconds = " to ".join(f"{step * timestep:.2f}" for step in dict.fromkeys((self.first, self.last)))
        value = " to ".join(dict.fromkeys((f"{self.worst:.3f}", f"{self.best:.3f}")))
        return f"{self.what}, at {when} ({seconds} s), robustness {value}"


def failed(explanations: Iterable[Explanation]) -> list[Reason]:
    """The reasons why trajectories fail (robustness not above 0), the most frequent first."""
    return merge(
        Reason(describe(why), 1, why.step, why.step, why.value, why.value) for why in explanations if not why.satisfied
    )


def describe(why: Explanation) -> str:
    """The deciding predicate as code, such as "`!(ee.z < table_height)` in table": it should not hold there."""
    if why.predicate is None:
        return f"the {why.edge} of the trajectory"
    atom = f"!({why.predicate})" if why.negated else why.predicate
    return f"`{atom}`" + (f" in {why.name}" if why.name else "")


def merge(reasons: Iterable[Reason]) -> list[Reason]:
    """Merges reasons with the same text, the most frequent first; if equally frequent, the earlier first."""
    groups: dict[str, list[Reason]] = {}
    for reason in reasons:
        groups.setdefault(reason.what, []).append(reason)
    merged = [
        Reason(
            what,
            sum(r.count for r in group),
            min(r.first for r in group),
            max(r.last for r in group),
            min(r.worst for r in group),
            max(r.best for r in group),
        )
        for what, group in groups.items()
    ]
    return sorted(merged, key=lambda reason: -reason.count)


def to_json(reasons: Sequence[Reason]) -> list[dict[str, Any]]:
    """Reasons as plain data for done.json."""
    return [asdict(reason) for reason in reasons]


def from_json(saved: Sequence[Mapping[str, Any]]) -> list[Reason]:
    """Reasons from the plain data of done.json."""
    return [Reason(**reason) for reason in saved]
