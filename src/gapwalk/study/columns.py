"""The columns that several tables have: measures of a motion, and parameters."""

from __future__ import annotations

from collections.abc import Sequence

from gapwalk.bifurcation.locus import LocusPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.orbit.balance import BalancedOrbit
from gapwalk.orbit.measures import MEASURES
from gapwalk.orbit.orbit import Orbit
from gapwalk.study.options import BranchOptions


def measure_names(coordinates: Sequence[str]) -> list[str]:
    """The headings of the measures: maximum, minimum, half the peak to peak, mean and rms of each coordinate."""
    return [f"{kind}.{q}" for q in coordinates for kind in MEASURES]


def measure_values(point: BranchPoint | LocusPoint) -> list[float]:
    """The measures of a point, in the order of `measure_names`."""
    return [point.measure(name) for name in measure_names(point.orbit.system.coordinates)]


def method_names(options: BranchOptions) -> list[str]:
    """The headings of what a method has to say of each orbit: of harmonic balance its harmonics and what they lack."""
    return ["harmonics", "truncation"] if options.balanced else []


def method_values(orbit: Orbit) -> list[float]:
    """The number of harmonics and the truncation error of an orbit; nothing of one that was found by shooting."""
    return [orbit.harmonics, orbit.truncation] if isinstance(orbit, BalancedOrbit) else []


def method_document(orbit: Orbit) -> dict[str, float]:
    """The same as JSON values."""
    return dict(zip(("harmonics", "truncation"), method_values(orbit), strict=False))


def parameter_headings(parameters: Sequence[str], coordinates: Sequence[str]) -> list[str]:
    """The headings of parameters: their names, but ``parameter mean.q1`` where a measure is called ``mean.q1``."""
    taken = measure_names(coordinates)
    return [f"parameter {name}" if name in taken else name for name in parameters]
