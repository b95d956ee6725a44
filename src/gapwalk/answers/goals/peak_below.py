"""The goal that the peak of a signal stays below a limit over a band."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from gapwalk.answers.goals.goal import LOWEST, Goal, Need
from gapwalk.answers.local_response import LocalResponse, band_points
from gapwalk.attractors.rattle import largest
from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.flow.motion import force_of, signal_names, signal_place
from gapwalk.flow.quadrature import quadrature
from gapwalk.model.system import System
from gapwalk.model.words import between_words
from gapwalk.orbit.orbit import Orbit

_FAR = 0.5  # margin, as a share of a limit, beyond which a peak does not count in one step


@dataclass(frozen=True)
class PeakBelow(Goal):
    """The peak of a signal, such as the torque in a link, stays below a limit over a band, stable motion or not.

    Examples
    --------
    >>> gw.ask.PeakBelow("stop", 9.0, (1.2, 1.35)).words(system, "frequency")
    'peak of stop below 9 between Ω = 1.2 and 1.35'
    """

    #: Name of a contact, for its force; of a shaft or gear of a drive train, for its whole torque, that of its
    #: permanent spring and damper included; or any signal, as in `Orbit.signal`.
    signal: str
    limit: float  #: The limit of its magnitude, in the unit of the signal (N m for a torque) or non-dimensional.
    within: tuple[float, float]  #: The band.

    def words(self, system: System, parameter: str) -> str:
        """Describe the goal."""
        unit = f" {unit}" if (unit := _unit(system, peak_signal(system, self.signal))) else ""
        return f"peak of {self.signal} below {self.limit:g}{unit} {between_words(self.within, parameter, system.units)}"

    def check(self, system: System, ends: tuple[float, float]) -> None:
        """Raise a ModelError if there is no such signal, the limit is no size, or the band leaves the range."""
        super().check(system, ends)
        name = peak_signal(system, self.signal)
        rigid = [each for each in system.structure.contacts if each.law.rebounds]
        if rigid and (name.endswith("''") or name in map(force_of, rigid)):
            raise ModelError(
                f"a goal limits the peak of {self.signal}, which is infinite where the rigid stop {rigid[0].name} is "
                f'struck; write a goal without impacts, {{ quiet = "{rigid[0].name}" }}'
            )
        if not self.limit > 0.0:
            raise ModelError(f"the limit of {self.signal} is {self.limit!r}; it must be a number > 0")

    def needs(self, response: LocalResponse, way: str, margin: float) -> list[Need]:
        """Return the margins where the peaks of either sign are largest: where both are equal, both count."""
        return [
            Need(
                value - margin,
                response.slopes(place, partial(self._left, sign=sign)),
                f"peak of {self.signal} {sign * self.limit * (1.0 - value):.6g} at {place.point.value:.6g}",
            )
            for sign in (1, -1)
            for place, value in response.lowest(partial(self._left, sign=sign), *self.within, most=LOWEST)
            if value < _FAR
        ]

    def margin(self, response: LocalResponse) -> float:
        """Return the distance from the limit, as a share of it."""
        return min(response.lowest(partial(self._left, sign=sign), *self.within)[0][1] for sign in (1, -1))

    def against(self, branch: Branch) -> list[str]:
        """Return a sentence if the peak is above the limit on the branch inside the band."""
        points = band_points(branch, *self.within)
        peaks = [(-self._left(point, sign=sign), point.value) for point in points for sign in (1, -1)]
        share, value = max(peaks, default=(-1.0, 0.0))
        if share <= 0.0:
            return []
        return [f"the peak of {self.signal} on an isolated branch is {(1.0 + share) * self.limit:.6g} at {value:.6g}"]

    def _left(self, point: BranchPoint, *, sign: int) -> float:
        key = f"peaks of {self.signal}"
        if key not in point.memo:
            point.memo[key] = peaks(point.orbit, self.signal)
        return 1.0 - point.memo[key][sign < 0] / self.limit


def peak_signal(system: System, name: str) -> str:
    """Return the signal of a contact, of a shaft or gear, or of any other name, as `Motion.signal` knows it."""
    known = signal_names(system)
    if f"{name}.torque" in known:
        return f"{name}.torque"
    contacts = {form.name: form for form in system.structure.contacts}
    if name not in known and name in contacts:
        return force_of(contacts[name])
    return known[signal_place(system, name)]


def peaks(orbit: Orbit, signal: str) -> tuple[float, float]:
    """Return the largest value of a signal in an orbit, and the largest of its negative, in the unit of the signal."""
    name, along = (
        peak_signal(orbit.system, signal),
        quadrature(orbit.system, orbit.state, orbit.period, orbit.known_states),
    )
    nodes = np.arange(len(along.motion.theta))
    highest, lowest = (
        largest(along, nodes, lambda motion, sign=sign: sign * motion.signal(name)) for sign in (1.0, -1.0)
    )
    return highest, lowest


def _unit(system: System, signal: str) -> str:
    return system.units.signal(signal)[1] if system.units else ""
