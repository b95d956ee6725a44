"""Boundaries of basins: the saddle on one by bisection, one-dimensional manifolds of saddles, and their crossings.

A manifold of a period map P with the multiplier mu is the image of a short piece of its tangent at the saddle: the
point ``P^k(s + d |mu|^t v)`` for t from 0 to 1 and k = 0, 1, ... (Hobson 1993, J. Comput. Phys. 104, 14-22). The stable
one is that of the motion backwards in time. The piece is so short that its distance from the manifold is below
rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.basins import UNRESOLVED, Catalogue, explore, sort_states
from gapwalk.attractors.many_motions import ExactMotions
from gapwalk.attractors.section import Strobe
from gapwalk.errors import ConvergenceError, ModelError, NumericalError
from gapwalk.flow.motion import check_state
from gapwalk.model.bounds import Counted, Positive, check
from gapwalk.model.system import System
from gapwalk.notebook import Shown
from gapwalk.orbit.find import find_orbit
from gapwalk.orbit.orbit import Orbit, true_period

_SHORT = 1e-7  # the first piece, in sizes of the motion: its distance from the manifold is the square of that
_FINEST = 1e-10  # of the parameter t + k, below which no interval is halved
_MOST = 100_000  # points of a side
_ROUNDS = 12  # of bisection and following, to come to the saddle
_HELD = 40  # largest number of forcing periods for which a motion follows the boundary
_SEEN = 20  # points of a stable manifold that are followed forwards
_LONGEST = 3000  # forcing periods until a motion is on its attractor


@dataclass(frozen=True, eq=False)
class Manifold(Shown):
    """One-dimensional manifold of a saddle, as two lines of states at theta = 0."""

    orbit: Orbit  #: The saddle.
    which: str  #: ``stable`` or ``unstable``.
    multiplier: float  #: Its multiplier.
    #: first, second: shape (points, state_size): The sides of the manifold, each from the saddle on.
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    accuracy: float  #: Largest distance of the manifold from the lines between neighbouring points.

    @property
    def system(self) -> System:
        """The system."""
        return self.orbit.system

    @property
    def lengths(self) -> tuple[float, float]:
        """Lengths of both sides."""
        first, second = (
            float(np.linalg.norm(np.diff(side, axis=0), axis=1).sum()) for side in (self.first, self.second)
        )
        return first, second

    def crossings(self, other: Manifold) -> NDArray[np.float64]:
        """Return the states at which it crosses another manifold of a system of two states, shape (crossings, 2)."""
        # Those of the stable and the unstable manifold of one saddle are homoclinic points.
        found = [_crossings(a, b) for a in (self.first, self.second) for b in (other.first, other.second)]
        points = np.vstack(found)
        return points[np.linalg.norm(points - self.orbit.state, axis=1) > 10.0 * max(self.accuracy, other.accuracy)]

    def __repr__(self) -> str:
        count, lengths = len(self.first) + len(self.second), " and ".join(f"{each:.4g}" for each in self.lengths)
        return f"Manifold({self.which}, multiplier {self.multiplier:.6g}, {count} points, lengths {lengths})"


def manifold(
    orbit: Orbit, which: Literal["stable", "unstable"] = "unstable", length: float = 10.0, *, accuracy: float = 1e-3
) -> Manifold:
    """Compute the one-dimensional stable or unstable manifold of a saddle.

    Parameters
    ----------
    orbit
        The saddle: an orbit with exactly one multiplier outside the unit circle; for ``"stable"``, exactly one inside.
    which
        ``"unstable"`` or ``"stable"``. The stable manifold is followed backwards in time, so no force except linear
        damping may depend on rates.
    length
        Least length, in the space of states, of each of the two sides on which the manifold leaves the saddle.
    accuracy
        Largest distance of the manifold from the lines between its points.

    Returns
    -------
    Manifold
        The two sides, each as a line of states at theta = 0.

    Raises
    ------
    ModelError
        If the orbit has no such manifold, or its motions cannot be followed backwards.

    Notes
    -----
    Hobson (1993), Journal of Computational Physics 104, 14-22.

    Examples
    --------
    >>> wells = gw.System(
    ...     ["x"],
    ...     [[0.0]],
    ...     damping=[[0.1]],
    ...     contacts=[gw.force("well", {"x": 1.0}, "x**3 - x")],
    ...     harmonics=[gw.Harmonic(0.05, {"x": 1.0})],
    ...     frequency=1.0,
    ... )
    >>> saddle = gw.find_orbit(wells, start=np.array([-0.025, 0.0]))
    >>> gw.analysis.manifold(saddle, "unstable", 2.0).multiplier > 1.0
    True
    """
    check("length", length, Positive)
    check("accuracy", accuracy, Positive)
    if which not in ("stable", "unstable"):
        raise ModelError(f'which is {which!r}; write "stable" or "unstable"')
    outside = np.abs(orbit.multipliers) > 1.0
    places = np.flatnonzero(outside if which == "unstable" else ~outside)
    if len(places) != 1:
        raise ModelError(
            f"the orbit has {len(places)} multipliers {'outside' if which == 'unstable' else 'inside'} the unit "
            f"circle; its {which} manifold is a line only if there is exactly one"
        )
    place = int(places[0])
    multiplier, direction = float(orbit.multipliers[place].real), np.real(orbit.eigenvectors[:, place])
    turns = 2 if multiplier < 0.0 else 1  # after two periods, a point is on its side again
    growth = float(abs(np.log(abs(multiplier)))) * turns
    flipped = np.ones(orbit.system.state_size)
    system = orbit.system
    if which == "stable":
        system = _backwards(system)
        flipped[system.size : 2 * system.size] = -1.0
    strobe, periods = Strobe(system), turns * orbit.period
    size = float(np.abs(orbit.extremes[:, :2]).max()) or 1.0
    start, way = flipped * orbit.state, flipped * direction * _SHORT * max(1.0, size)

    def point(sign: float, place: float) -> NDArray[np.float64]:
        count = int(place)
        state = start + sign * way * np.exp(growth * (place - count))
        for _ in range(count):
            state = strobe.arc(state, periods).state
        return flipped * state

    sides = [_line(partial(point, sign), orbit.state, length, accuracy) for sign in (1.0, -1.0)]
    found = Manifold(orbit, which, multiplier, sides[0], sides[1], accuracy)
    if which == "stable":
        _check_backwards(found, periods)
    return found


def _line(point, saddle: NDArray[np.float64], length: float, accuracy: float) -> NDArray[np.float64]:
    """Return the points of one side, each interval halved until its middle is on the chord."""
    # The first interval is a period, in which the line of a few points would miss folds: it is divided beforehand.
    line, reached, place = [saddle, point(0.0)], 0.0, 0.0
    while reached < length and len(line) < _MOST:
        waiting = [(place + 0.125, point(place + 0.125))]
        while waiting and reached < length:
            end, last = waiting[-1]
            middle = 0.5 * (place + end)
            between = point(middle)
            chord = last - line[-1]
            off = between - line[-1]
            along = float(np.clip(off @ chord / max(chord @ chord, 1e-300), 0.0, 1.0))
            if np.linalg.norm(off - along * chord) > accuracy and end - place > _FINEST:
                waiting.append((middle, between))
                continue
            waiting.pop()
            reached += float(np.linalg.norm(off) + np.linalg.norm(last - between))
            line += [between, last]
            place = end
            if not np.isfinite(reached):
                raise ModelError(f"the manifold leaves to infinity after the length {length:g}: ask for a shorter one")
    return np.array(line)


def _backwards(system: System) -> System:
    """Return the system whose motions are those of another one backwards in time, with the opposite rates."""
    changes = {name: -system[name] for name in system.structure.names if name.startswith("damping.")}
    changes |= {name: -system[name] for name in system.structure.names if name.endswith(".phase")}
    try:
        return system.at(changes)
    except ModelError as error:
        raise ModelError(f"the motions cannot be followed backwards: {error}") from None


def _check_backwards(found: Manifold, periods: int) -> None:
    """Raise a ModelError if the points do not move along the manifold towards the saddle."""
    strobe = Strobe(found.system)
    for side in (found.first, found.second):
        for state in side[np.linspace(1, len(side) - 1, _SEEN).astype(int)]:
            after = strobe.arc(state, periods).state
            if float(_distances(after, side).min()) > 2.0 * found.accuracy:
                raise ModelError(
                    "the motions cannot be followed backwards: a force depends on a rate, or a load is not a harmonic; "
                    "ask for the unstable manifold, or take that force or load out of the model"
                )


def _distances(state: NDArray[np.float64], line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances of a state from the pieces of a line."""
    chords, off = np.diff(line, axis=0), state - line[:-1]
    sizes = np.maximum((chords**2).sum(axis=1), 1e-300)
    along = np.clip((off * chords).sum(axis=1) / sizes, 0.0, 1.0)
    return np.linalg.norm(off - along[:, None] * chords, axis=1)


def _crossings(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points at which two lines in a plane cross, shape (crossings, 2)."""
    if a.shape[1] != 2:
        raise ModelError(f"manifolds of {a.shape[1]} states do not cross in points; points exist with two states only")
    found = [np.empty((0, 2))]
    d, start = np.diff(b, axis=0), b[:-1]
    low, high = np.minimum(b[:-1], b[1:]), np.maximum(b[:-1], b[1:])
    for p, q in pairwise(a):
        near = ((high >= np.minimum(p, q)) & (low <= np.maximum(p, q))).all(axis=1)
        if not near.any():
            continue
        r, w = q - p, start[near] - p
        cross = r[0] * d[near, 1] - r[1] * d[near, 0]
        with np.errstate(all="ignore"):
            s = (w[:, 0] * d[near, 1] - w[:, 1] * d[near, 0]) / cross
            t = (w[:, 0] * r[1] - w[:, 1] * r[0]) / cross
        inside = (s >= 0.0) & (s < 1.0) & (t >= 0.0) & (t < 1.0)
        found.append(p + s[inside, None] * r)
    return np.vstack(found)


def edge_state(
    system: System, first: NDArray[np.float64], second: NDArray[np.float64], *, max_period: int = 8
) -> Orbit:
    """Find the saddle on the boundary between the basins of two motions, by bisection between two states.

    Parameters
    ----------
    system
        The system.
    first, second : shape (state_size,)
        States that settle on different motions.
    max_period
        Longest period of the saddle that is tried, in forcing periods.

    Returns
    -------
    Orbit
        The saddle. It has one unstable multiplier, and motions leave it on either side to one of the two motions.

    Raises
    ------
    ModelError
        If both states settle on the same motion.
    ConvergenceError
        If no such orbit was found, for example because the boundary has a chaotic saddle.

    Notes
    -----
    Skufca, Yorke and Eckhardt (2006), Physical Review Letters 96, 174101.

    Examples
    --------
    >>> wells = gw.System(
    ...     ["x"],
    ...     [[0.0]],
    ...     damping=[[0.1]],
    ...     contacts=[gw.force("well", {"x": 1.0}, "x**3 - x")],
    ...     harmonics=[gw.Harmonic(0.05, {"x": 1.0})],
    ...     frequency=1.0,
    ... )
    >>> saddle = gw.analysis.edge_state(wells, np.array([-1.0, 0.0]), np.array([1.0, 0.0]))
    >>> saddle.period, int((abs(saddle.multipliers) > 1.0).sum())
    (1, 1)
    """
    check("max_period", max_period, Counted)
    ends = np.array([check_state(system, np.asarray(first)), check_state(system, np.asarray(second))])
    advance = ExactMotions(system).advance
    catalogue, labels = explore(Catalogue(system), advance, ends, longest=_LONGEST, max_period=64, tries=8)
    if UNRESOLVED in labels or labels[0] == labels[1]:
        where = "one motion" if labels[0] == labels[1] else "no motion that was found"
        raise ModelError(f"both states lead to {where}; give states from two basins, as gw.basins shows them")

    def label(state: NDArray[np.float64]) -> int:
        return int(sort_states(advance, state[None], catalogue.signatures, _LONGEST).labels[0])

    strobe = Strobe(system)
    for _ in range(_ROUNDS):
        a, b = ends
        while np.abs(b - a).max() > 1e-14 * max(1.0, np.abs(a).max()):
            middle = 0.5 * (a + b)
            a, b = (middle, b) if label(middle) == labels[0] else (a, middle)
        track = [(a, b)]
        while len(track) < _HELD and np.abs(track[-1][1] - track[-1][0]).max() < 1e-4:
            track.append((strobe.arc(track[-1][0], 1).state, strobe.arc(track[-1][1], 1).state))
        line = np.array([0.5 * (low + high) for low, high in track])
        for period in range(1, min(max_period, len(line) - 1) + 1):
            place = int(np.argmin(np.linalg.norm(line[period:] - line[:-period], axis=1)))
            try:
                orbit = find_orbit(system, period, start=line[place])
            except NumericalError:
                continue
            if true_period(orbit) == period and _is_between(orbit, label, set(labels.tolist())):
                return orbit
        near = next(
            (pair for pair in reversed(track) if {label(pair[0]), label(pair[1])} == set(labels.tolist())), None
        )
        if near is None:
            break
        ends = np.array(near) if label(near[0]) == labels[0] else np.array(near[::-1])
    raise ConvergenceError(
        f"no orbit up to period {max_period} on the boundary was found; raise max_period, or begin with other states: "
        "the boundary may have a chaotic saddle, as a small exponent of gw.basins(...).uncertainty() says"
    )


def _is_between(orbit: Orbit, label, both: set[int]) -> bool:
    """Return True if motions that leave an orbit to both sides settle on both motions."""
    if int((np.abs(orbit.multipliers) > 1.0).sum()) != 1 or orbit.multipliers[0].real < 0.0:
        return False
    way = 1e-6 * np.real(orbit.eigenvectors[:, 0])
    return {label(orbit.state + way), label(orbit.state - way)} == both
