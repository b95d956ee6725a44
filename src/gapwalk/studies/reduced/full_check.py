"""How far a branch of a reduced system is from that of the full one, as a result keeps it."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class FullCheck:
    """How far a branch is from that of the full system.

    Attributes
    ----------
    branch
        Its name.
    errors
        Estimated error of the parameter value of each special point, in their order; inf where none was found near by
        in the full system.
    motion
        Largest estimated error of a motion, relative to its size.
    harmonics
        Harmonics with which it was checked; 0 if that failed.
    detail
        Why it failed.
    """

    branch: str
    errors: tuple[float, ...]
    motion: float
    harmonics: int
    detail: str = ""

    @property
    def words(self) -> str:
        """The same in words."""
        if self.detail:
            return f"{self.branch} could not be set against the full system: {self.detail}"
        known = [error for error in self.errors if math.isfinite(error)]
        texts = ["it has no special points"]
        if self.errors:
            within = f", and differ by {max(known):.1e} at most" if known else ""
            texts = [f"{len(known)} of its {len(self.errors)} special points are there{within}"]
        texts.append(
            f"motions differ by {self.motion:.1e} of their size at most"
            if math.isfinite(self.motion)
            else "some of its motions are not there: the reduced system has too few modes for them"
        )
        return f"{self.branch} set against the full system, by {self.harmonics} harmonics: {'; '.join(texts)}"
