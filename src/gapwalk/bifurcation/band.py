"""Settled motions where no orbit is followed: what is drawn as a band beside the stretches of a branch.

Where several gaps rattle, no two neighbouring values of a parameter have the same sequence of contacts, so that a curve
would have a graze at each step, or none exists. What settles there has a least, a mean and a largest value.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.measures import full_measure, parsed
from gapwalk.model.system import System
from gapwalk.model.words import range_words

_SAME = 0.5  # difference of the separations in a period from which on they count as others


@dataclass(frozen=True, eq=False)
class Band:
    """Settled motion at one value of the parameter of a branch, over as many forcing periods as it was watched."""

    value: float  #: Value of the parameter.
    state: NDArray[np.float64]  #: shape (state_size,): A state at theta = 0.
    period: int  #: Period in forcing periods; 0 if the motion does not repeat within eight.
    extremes: NDArray[np.float64]  #: shape (3, n): Least, mean and largest value of each coordinate.
    #: shape (contacts,): Separations per forcing period of each contact; nan for one without a gap.
    separations: NDArray[np.float64]

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.extremes.ndim != 2 or len(self.extremes) != 3 or self.state.ndim != 1 or self.separations.ndim != 1:
            raise ValueError("the arrays of a settled motion have wrong shapes")

    @property
    def total(self) -> float:
        """Separations per forcing period of all contacts."""
        return float(np.nansum(self.separations))

    @property
    def kind_words(self) -> str:
        """Its period in words."""
        return f"settled, period {self.period}" if self.period else "settled, not periodic"

    def separation_words(self, system: System) -> str:
        """Return the contacts that separate, with how often in a forcing period."""
        names = [form.name for form in system.structure.equations.contacts]
        parts = [f"{name} {count:.4g}" for name, count in zip(names, self.separations, strict=True) if count > 0.0]
        return ", ".join(parts) or "none"

    def shown(self, system: System, measure: str) -> tuple[float, float, float] | None:
        """Return the least, middle and largest height in the picture of a measure; None if that is not known of it.

        They are values of the coordinate, of which the middle one is the one asked for; of ``half``, their distances
        from the mean, of which it is the middle.
        """
        asked = parsed(full_measure(measure, system.coordinates))
        if asked is None or asked.signal not in system.coordinates or asked.over or asked.is_level or asked.orders:
            return None
        low, mean, high = self.extremes[:, system.coordinates.index(asked.signal)].tolist()
        if asked.kind in ("half", "peak_to_peak"):
            factor = 1.0 if asked.kind == "half" else 2.0
            return (
                factor * min(mean - low, high - mean),
                0.5 * factor * (high - low),
                factor * max(mean - low, high - mean),
            )
        middle = {"max": high, "min": low, "mean": mean}.get(asked.kind)
        return None if middle is None else (low, middle, high)


def band_rows(bands: Sequence[Band], parameter: str, system: System) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table of settled motions."""
    for band in bands:
        row: dict[str, Any] = {parameter: band.value, "period": band.period, "separations": band.total}
        for name, values in zip(system.coordinates, band.extremes.T.tolist(), strict=True):
            row |= {f"{kind}.{name}": value for kind, value in zip(("least", "mean", "largest"), values, strict=True)}
        yield row


def runs_of(bands: Sequence[Band]) -> list[list[Band]]:
    """Return the bands in runs without a stretch of the curve between them."""
    runs: list[list[Band]] = []
    step = min((abs(two.value - one.value) for one, two in pairwise(bands)), default=0.0)
    for band in bands:
        if not runs or abs(band.value - runs[-1][-1].value) > 1.5 * step:
            runs.append([])
        runs[-1].append(band)
    return runs


def graze_words(bands: Sequence[Band], parameter: str, system: System) -> Iterator[str]:
    """Yield a sentence for each run of settled motions, and for the grazes of each contact in it."""
    for run in runs_of(bands):
        ends = min(run[0].value, run[-1].value), max(run[0].value, run[-1].value)
        periodic, most = sum(band.period > 0 for band in run), max(band.total for band in run)
        yield (
            f"settled, {range_words(ends, parameter, system.units)}: {len(run)} values, "
            f"at {periodic or 'none'} of them periodic, with up to {most:.4g} separations in a forcing period"
        )
        for place, form in enumerate(system.structure.equations.contacts):
            counts = np.array([band.separations[place] for band in run])
            if not np.nanmax(np.append(counts, 0.0)) > 0.0:
                continue
            words = (
                f"  {form.name}: separates at {np.sum(counts > 0)} of them, up to {max(counts):.4g} times in a period"
            )
            # where no motion repeats, the counts of neighbours differ by chance
            pairs = [pair for pair in pairwise(run) if all(band.period for band in pair)]
            changed = [pair for pair in pairs if abs(np.subtract(*(band.separations[place] for band in pair))) >= _SAME]
            if changed:
                values = [band.value for pair in changed for band in pair]
                around = range_words((min(values), max(values)), parameter, system.units)
                words += f"; about {len(changed)} graze{'s' if changed[1:] else ''}, {around}"
            yield words
