"""The quantities that figures and claims look at: of responses, of settled motions, and what the paper leaves out."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import gapwalk as gw
from reproductions.padmanabhan_singh_1995.jobs import MEASURE

Array = NDArray[np.float64]

# Responses: ranges of instability, peaks, special points.


class Range(NamedTuple):
    """A range of a parameter."""

    low: float
    high: float

    @property
    def width(self) -> float:
        """Its width."""
        return self.high - self.low

    def meets(self, low: float, high: float) -> bool:
        """Tell whether it overlaps another range."""
        return self.low <= high and low <= self.high

    def __str__(self) -> str:
        digits = next((n for n in range(4, 9) if f"{self.low:.{n}g}" != f"{self.high:.{n}g}"), 4)
        low, high = (f"{each:.{digits}g}".replace("-", "−") for each in self)
        return f"{low}{' to ' if high.startswith('−') else '–'}{high}"


class Peak(NamedTuple):
    """A local maximum of a response: parameter and height."""

    value: float
    height: float

    def __str__(self) -> str:
        return f"{self.height:.3g} at {self.value:.3g}"


def main_branch(result: gw.Result) -> gw.Branch:
    """Return the branch of period 1 that was followed first."""
    return result.branches[0]


def members(result: gw.Result, period: int) -> list[Any]:
    """Return the branches of one period."""
    assert result.diagram is not None
    return [member for member in result.diagram.members if member.period == period]


def values(branch: gw.Branch, kind: gw.Kind, low: float = -np.inf, high: float = np.inf) -> list[float]:
    """Return the parameter at the special points of one kind within a range, in order of size."""
    return sorted(special.value for special in branch.special(kind) if low <= special.value <= high)


def ranges(branch: gw.Branch, test: Callable[[Any], bool]) -> list[Range]:
    """Return the ranges of the parameter, from low to high, where the unstable multipliers of all motions pass a test.

    Parameters
    ----------
    branch
        The branch.
    test
        Takes the number of unstable multipliers, as `BranchPoint.instability` has it.
    """
    nodes = [(point.arclength, point.value, point.instability) for point in branch.points]
    nodes += [(special.point.arclength, special.value, special.after) for special in branch.special_points]
    nodes.sort(key=lambda node: node[0])
    found: list[list[float]] = []
    inside = False
    for _, value, instability in nodes:
        if inside:
            found[-1].append(value)  # the node at which a range ends belongs to it too
        passes = test(instability)
        if passes and not inside:
            found.append([value])
        inside = passes
    return sorted(Range(min(each), max(each)) for each in found)


def flipped(branch: gw.Branch) -> list[Range]:
    """Return where a multiplier lies beyond -1."""
    return ranges(branch, lambda instability: instability.below > 0)


def with_pair(branch: gw.Branch) -> list[Range]:
    """Return where a complex pair of multipliers lies outside the unit circle."""
    return ranges(branch, lambda instability: instability.pairs > 0)


def meeting(found: Sequence[Range], low: float, high: float) -> list[Range]:
    """Return the ranges that overlap another one."""
    return [each for each in found if each.meets(low, high)]


def covered(found: Sequence[Range], low: float, high: float) -> float:
    """Return how much of a range others cover; where they overlap it counts once."""
    width, end = 0.0, low
    for each in sorted(found):
        begin, stop = max(each.low, end), min(each.high, high)
        width, end = width + max(stop - begin, 0.0), max(end, stop)
    return width


def unstable_width(branch: gw.Branch, low: float, high: float) -> float:
    """Return how much of a range has an unstable motion of the branch; between the folds of a jump there is one."""
    return covered(ranges(branch, lambda instability: instability.total > 0), low, high)


def extent(branch: gw.Branch) -> Range:
    """Return the range of the parameter that a branch covers."""
    return Range(float(branch.values.min()), float(branch.values.max()))


def peaks(branch: gw.Branch, low: float = -np.inf, high: float = np.inf) -> list[Peak]:
    """Return the local maxima of the response along the branch within a range, by the parameter."""
    heights, places = branch.measure(MEASURE), branch.values
    inner = np.flatnonzero((heights[1:-1] > heights[:-2]) & (heights[1:-1] >= heights[2:])) + 1
    found = [Peak(float(places[i]), float(heights[i])) for i in inner if low <= places[i] <= high]
    return sorted(found)


def highest(branch: gw.Branch, low: float = -np.inf, high: float = np.inf) -> Peak:
    """Return the highest point of the response within a range."""
    heights, places = branch.measure(MEASURE), branch.values
    inside = np.flatnonzero((places >= low) & (places <= high))
    best = inside[np.argmax(heights[inside])]
    return Peak(float(places[best]), float(heights[best]))


def heights_at(branch: gw.Branch, grid: Array) -> Array:
    """Return the amplitude at each of many values of the parameter; where several motions exist, the largest."""
    heights, places = branch.measure(MEASURE), branch.values
    best = np.zeros_like(grid)
    for (a, b), (p, q) in zip(np.c_[places[:-1], places[1:]], np.c_[heights[:-1], heights[1:]], strict=True):
        inside = (grid >= min(a, b)) & (grid <= max(a, b))
        if inside.any() and a != b:
            best[inside] = np.maximum(best[inside], p + (q - p) * (grid[inside] - a) / (b - a))
    return best


def words(found: Sequence[object]) -> str:
    """List things in words; ``none`` if there are none."""
    return ", ".join(f"{each:.4g}" if isinstance(each, float) else str(each) for each in found) or "none"


def counted(count: int, name: str) -> str:
    """Return a number with its noun: ``1 branch``, ``2 branches``."""
    return f"{count} {name}{'' if count == 1 else 'es' if name.endswith('ch') else 's'}"


START = 20  # forcing periods of a start from rest that are shown and compared

# Settled motions: histories, force peaks, lines of spectra.


def attractor_of(result: gw.Result) -> Any:
    """Return the attractor on which a motion has settled."""
    assert isinstance(result.finding, gw.studies.SettleFinding)
    return result.finding.attractor


def orbit_of(result: gw.Result) -> gw.Orbit:
    """Return the periodic motion on which a motion has settled."""
    orbit = attractor_of(result).orbit
    assert orbit is not None
    return orbit


def over_two_periods(result: gw.Result, signal: str) -> Array:
    """Sample a signal of a periodic motion evenly over two forcing periods."""
    orbit = orbit_of(result)
    return np.tile(orbit.motion(512).signal(signal)[:-1], 2 // orbit.period or 1)


def difference(first: Array, second: Array) -> float:
    """Return the rms of the difference of two signals, as a share of the rms of the first about its mean."""
    return float(np.sqrt(np.mean((first - second) ** 2)) / np.std(first))


def force_peaks(orbit: gw.Orbit) -> tuple[int, int]:
    """Count how often the contact is pressed most, on each side, in one full period.

    This is what a picture of the contact force shows. Between two peaks the contact need not open, so there may be more
    peaks than impacts.
    """
    turns = np.array(orbit.turns[0].values)
    clearance = orbit.system["stage2.clearance"]
    before, after = np.roll(turns, 1), np.roll(turns, -1)
    high = (turns > before) & (turns > after) & (turns > clearance)
    low = (turns < before) & (turns < after) & (turns < -clearance)
    return int(high.sum()), int(low.sum())


def impact_words(pattern: str) -> str:
    """Say in words what the pattern of a contact, such as ``2+/1-``, counts in one period."""
    if pattern.startswith("closed"):
        return "contact never opens"
    counts = re.fullmatch(r"(\d+)\+/(\d+)-", pattern)
    return f"{counts[1]} and {counts[2]} impacts (+, − side)" if counts else pattern


def lines(orbit: gw.Orbit, signal: str) -> Array:
    """Return the amplitudes of the harmonics of the excitation frequency of a periodic motion, the first first."""
    found = gw.analysis.spectrum(orbit, signal)
    whole = np.isclose(found.orders % 1.0, 0.0) & (found.orders > 0.5)
    return found.amplitudes[whole]


# Figure 1: the force of a contact under a harmonic deflection by both damping laws.

VISCOUS, IMPACT = "viscous damping", "impact damping"


def _loops() -> dict[str, Any]:
    """Compute both loops; the damper costs as much per cycle as the impact damping, so that they can be compared.

    The paper prints no numbers for them. The clearance is 1, as in its tables, the amplitude twice that, and beta is
    larger than in any of its sets, so that the loop can be seen.
    """

    def loop(law: str, **numbers: float) -> Any:
        stop = (gw.Stage(clearance=1.0, side=gw.Side.POSITIVE),)
        return gw.analysis.hysteresis(gw.Contact("stop", {"x": 1.0}, stop, None, law, numbers), 2.0)

    impact = loop("hunt-crossley", impact_damping=0.5)
    damper = impact.loss / loop("viscous", viscous_damping=1.0).loss
    return {VISCOUS: loop("viscous", viscous_damping=damper), IMPACT: impact}


LOOPS = _loops()
"""The loops by the names of their laws."""


# Figure 8: the third inertia.


def third_inertia(system: gw.System) -> gw.measure.Signal:
    """Return u3'' about its mean, in units of the shaft's deflection bc3 times w^2, as a signal of the paper's system.

    Parameters
    ----------
    system
        A system of the paper: coordinates q1 and q3, and the contact ``stage2``.

    Notes
    -----
    The two degrees of freedom of the paper leave the third inertia out. By its equation 3, I3 u3'' = K2 q3 + C2 q3' -
    Tm. The tables hold K2/I2 bc3/bc1 = K12 and K2/I2 + K2/I3 = K22, so ``K2/I3 = K22 - K12 / r`` with r = bc3/bc1,
    which no table prints. It follows from the mean loads: one and the same torque Tm is behind Tm1 and Tm2, and with
    n2/n1 = Ia/(I2 r) that leaves ``r = K12 (Tm2 + n Tm1) / (n (Tm1 K22 + Tm2 K12))``, n = n2/n1. (At equal mean loads
    r = 16/17.) Then the mean of K2/I3 q3 is Tm2 for every motion, so that the train keeps its speed, and u3'' is what
    is left about the mean. C2/I3 is taken from the tables as K2/I3 is; they hold no damper that would fit both C12 and
    C22.
    """
    k12, k22 = -system["stiffness.q1.q3"], system["stiffness.q3.q3"]
    c12, c22 = -system["damping.q1.q3"], system["damping.q3.q3"]
    n = -system["stage2.force.q3"] / system["stage2.force.q1"]
    first, second = system["mean.q1"], system["mean.q3"]
    r = k12 * (second + n * first) / (n * (first * k22 + second * k12))
    return gw.measure.Signal((("q3", k22 - k12 / r), ("q3'", c22 - c12 / r)), "u3''")
