"""What the study of basins of attraction is asked to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from gapwalk.attractors.box import Window
from gapwalk.studies.basins.options import BasinOptions
from gapwalk.studies.options import StudyOptions

_LIMITS = BasinOptions()


@dataclass(frozen=True, slots=True)
class BasinStudyOptions(StudyOptions):
    """Basins of attraction in a plane of initial states.

    Parameters
    ----------
    window
        The plane and its part that is looked at.
    resolution
        Columns and rows of cells.
    longest, max_period, tries, exact_borders, check, seed, workers
        How the basins are found, as `gapwalk.BasinOptions`.
    """

    kind: ClassVar[str] = "basins"

    window: Window
    resolution: tuple[int, int] = (128, 128)
    longest: int = _LIMITS.longest
    max_period: int = _LIMITS.max_period
    tries: int = _LIMITS.tries
    exact_borders: bool = _LIMITS.exact_borders
    check: int = _LIMITS.check
    seed: int = _LIMITS.seed
    workers: int | None = field(default=None, compare=False)  # it changes nothing of the result

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        names, (columns, rows) = (self.window.across, self.window.up), self.resolution
        ranges = [
            f"{name} from {low:g} to {high:g}" for name, (low, high) in zip(names, self.window.within, strict=True)
        ]
        return f"basins over {' and '.join(ranges)}, {columns} x {rows} cells"

    @property
    def plane(self) -> dict[str, tuple[float, float]]:
        """The two axes and their ranges, the horizontal one first."""
        return dict(zip((self.window.across, self.window.up), self.window.within, strict=True))

    @property
    def fixed(self) -> dict[str, float]:
        """The other components of the state."""
        box = self.window.box
        return {name: low for name, low in zip(box.names, box.low, strict=True) if name not in self.plane}

    @property
    def limits(self) -> BasinOptions:
        """How the basins are found, and in how many processes."""
        names = ("longest", "max_period", "tries", "exact_borders", "check", "seed", "workers")
        return BasinOptions(**{name: getattr(self, name) for name in names})
