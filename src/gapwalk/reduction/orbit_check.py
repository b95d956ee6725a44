"""Error of an orbit of a reduced system, compared with the full system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gapwalk.errors import NumericalError
from gapwalk.orbit.harmonic_balance import Balance
from gapwalk.orbit.newton import solve
from gapwalk.orbit.orbit import Orbit
from gapwalk.reduction.paired_equations import Pair, method_for

if TYPE_CHECKING:
    from gapwalk.reduction.reduction import Reduction


@dataclass(frozen=True)
class OrbitCheck:
    """The comparison of an orbit of the reduced system with the full system's equation.

    Attributes
    ----------
    orbit
        The orbit.
    error
        Estimated error of the deflections of the contacts: the largest sum of the errors of the amplitudes of all
        harmonics, relative to the largest sum of amplitudes. inf if the full system has no such motion nearby.
    harmonics
        Number of harmonics of the check.
    """

    orbit: Orbit
    error: float
    harmonics: int

    def __repr__(self) -> str:
        return f"OrbitCheck(deflections within {self.error:.2g} of the full system's, with {self.harmonics} harmonics)"


def check_orbit(reduction: Reduction, orbit: Orbit, method: Balance | None = None) -> OrbitCheck:
    """Check an orbit; see `Reduction.check`."""
    pair = Pair(reduction, orbit.system, None, orbit.period, method_for(orbit, method))
    full = pair.full  # raises an error if the system is not the reduced one
    unknowns, _ = solve(pair.reduced, pair.reduced.unknowns(orbit), 0.0)
    try:
        error = pair.correct(unknowns).change
    except (NumericalError, np.linalg.LinAlgError):
        error = float("inf")
    return OrbitCheck(orbit, error, full.harmonics)
