"""One line of the table: a measurement, its baseline, and the targets that it should reach."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Target:
    """A limit that a line should reach.

    Parameters
    ----------
    limit
        Seconds at most, or the ratio to the baseline at least, or the number of special points to find.
    kind
        Which of them: ``"seconds"``, ``"ratio"`` or ``"found"``.
    """

    limit: float
    kind: str = "seconds"


@dataclass(frozen=True)
class Row:
    """One measurement.

    Parameters
    ----------
    group
        The heading above it.
    what
        What was done.
    seconds
        CPU time of gapwalk, the least of several repeats.
    baseline
        CPU time of the baseline for the same, or None where there is none.
    against
        What the baseline is.
    targets
        What the line should reach.
    counts
        Work done: points, flow calls, and so on.
    note
        A remark to print below it.
    """

    group: str
    what: str
    seconds: float
    baseline: float | None = None
    against: str = "SciPy"
    targets: tuple[Target, ...] = ()
    counts: Mapping[str, float] = field(default_factory=dict)
    note: str = ""

    @property
    def ratio(self) -> float | None:
        """How many times as fast as the baseline."""
        return None if self.baseline is None else self.baseline / self.seconds

    @property
    def reached(self) -> tuple[bool, ...]:
        """For each target whether it is reached."""
        return tuple(bool(self._reaches(target)) for target in self.targets)  # NumPy's numbers compare to its own bool

    def as_dict(self) -> dict[str, Any]:
        """The row in plain types, for JSON."""
        return {
            "group": self.group,
            "what": self.what,
            "seconds": self.seconds,
            "baseline": self.baseline,
            "against": self.against if self.baseline is not None else "",
            "ratio": self.ratio,
            "targets": [{"limit": target.limit, "kind": target.kind} for target in self.targets],
            "reached": list(self.reached),
            "counts": dict(self.counts),
            "note": self.note,
        }

    def _reaches(self, target: Target) -> bool:
        match target.kind:
            case "seconds":
                return self.seconds <= target.limit
            case "ratio":
                return self.ratio is not None and self.ratio >= target.limit
            case "found":
                return self.counts["special points found"] >= target.limit
        raise ValueError(f"there is no kind of target {target.kind!r}")
