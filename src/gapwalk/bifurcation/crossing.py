"""Branch points: located from their surroundings, because Newton's method cannot hold a point where branches cross."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from gapwalk.bifurcation.stretch import Stretch
from gapwalk.continuation.point import BranchPoint

_NODES = 7
_NEAR = 0.08  # share of the window around the crossing from which no node is taken
_NARROWING = (1.0, 0.2)  # windows, in lengths of the step, in which the crossing is located one after the other


def locate_crossing(stretch: Stretch, a: BranchPoint, b: BranchPoint, rough: float) -> tuple[BranchPoint, float]:
    """The point between `a` and `b` where branches cross, and the uncertainty of its parameter value.

    Near the crossing the Jacobian is singular along the other branch: a residual of 1e-10 leaves an error of its
    square root or worse. The branch itself is smooth, so points at some distance on both sides, which Newton's
    method holds well, give the zero of the bordered determinant and the orbit there by interpolation.

    Parameters
    ----------
    stretch
        The stretch between two points of the walk.
    a, b
        The points between which the determinant changes its sign.
    rough
        Arclength near the zero.
    """
    chord = (b.x - a.x) / (b.arclength - a.arclength)
    unit = chord / float(chord @ chord)
    root, length = rough, b.arclength - a.arclength
    for share in _NARROWING:
        window = share * length
        nodes = _nodes(stretch, min(max(a.arclength, root - 0.5 * window), b.arclength - window), window, root)
        # how far along the chord the points stand: a parameter along which they are smooth, as their labels are not
        along = np.array([a.arclength + float((node.x - a.x) @ unit) for node in nodes]) - root
        determinants = [node.determinant for node in nodes]
        shift = _zero(along / window, determinants) * window
        spread = abs(_zero(along[1:-1] / window, determinants[1:-1]) * window - shift)
        root += shift
    x = np.array([_fit((along - shift) / window, [node.x[i] for node in nodes])(0.0) for i in range(len(a.x))])
    point = stretch.insert_uncorrected(x, root)
    return point, abs(float(point.tangent[-1])) * spread


def _nodes(stretch: Stretch, low: float, window: float, centre: float) -> list[BranchPoint]:
    """Exact points of a window, denser towards its ends, none too near to its centre."""
    places = low + window * 0.5 * (1.0 - np.cos(np.pi * np.arange(_NODES) / (_NODES - 1)))
    away = [float(place) for place in places if abs(place - centre) > _NEAR * window]
    return [stretch.corrector.refined(stretch.at(place)) for place in away]


def _zero(places: NDArray[np.float64], values: list[float]) -> float:
    """The zero nearest to the origin of the polynomial through values at places."""
    roots: NDArray[np.complex128] = _fit(places, values).roots()
    real = roots[np.abs(roots.imag) < 1e-6].real
    return float(real[np.argmin(np.abs(real))]) if len(real) else 0.0


def _fit(places: NDArray[np.float64], values: list[float]) -> Polynomial:
    return Polynomial.fit(places, values, len(places) - 1, domain=[-1.0, 1.0])
