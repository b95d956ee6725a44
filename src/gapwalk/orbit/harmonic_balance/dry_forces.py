"""Forces of Jenkins elements along a motion given by its lines, exact to rounding, with all derivatives.

The phases of an element come from `slip_sequence`. In stick its force is ``k (x - p)``, with the place p of its slider,
in slip plus or minus its limit. The function that is 1 in some phases has its spectrum in closed form; so the lines of
the force in stick are convolutions, like those of a contact. A limit that varies over a phase of slip is integrated by
Gauss's rule between the events, which is exact to rounding.

In the derivatives the events need not be moved, because the force is continuous there. But in each phase of stick the
slider stands where a bound ``x - r`` or ``x + r`` came to rest, at its pin: so the force depends on the motion at that
one angle, too. Such a derivative is a product of lines and of a linear function of the unknowns, a *link*. Where the
limit jumps the force may jump: then the event moves with the host, which is a link as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.dry_state import SlipEvent
from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.laws import Friction
from gapwalk.orbit.harmonic_balance.linear_part import ForcesLessShares, Share, firsts_of
from gapwalk.orbit.harmonic_balance.sampled_forces import NO_PAIRS, Pairs
from gapwalk.orbit.harmonic_balance.series import waves
from gapwalk.orbit.harmonic_balance.slip_limit import TURN, Element, Motion, Slider
from gapwalk.orbit.harmonic_balance.slip_sequence import Leap, Phase, Pin, sequence_of

Array = NDArray[np.float64]

_NODES, _WEIGHTS = legendre.leggauss(20)
_ROUNDING = 1e-12  # multipliers that are 0 but for rounding, over the largest


class Links(NamedTuple):
    """Changes of forces with the motion at single angles: lines times linear functions of the unknowns."""

    forces: NDArray[np.intp]  #: shape (links,): Number of the deflection with which each force acts.
    columns: NDArray[np.complex128]  #: shape (links, K + 1): Lines of the force.
    #: shape (links, unknowns): The linear functions of the real forms of all deflections, one after the other.
    rows: Array


class DryForces(ForcesLessShares):
    """The forces of Jenkins elements."""

    def along(self, lines: NDArray[np.complex128], period: int, crossings: Array) -> Memory:
        """Return the forces along deflections with some lines, which pass breakpoints at known crossings."""
        motion = Motion(self.layout, self.coefficients, self.slope, lines, period, crossings)
        found = []
        for element in elements_in(self.layout):
            share = next((each for each in self.shares if each.place == element.place), Share(element.place, 0.0, 0.0))
            found.append(DryForce(Slider(motion, element), share))
        return Memory(tuple(found))


@dataclass(frozen=True, eq=False)
class DryForce:
    """The force of one element along a motion, less its share."""

    #: slider, share: The slider with the motion, and what is taken away.
    slider: Slider
    share: Share

    def __post_init__(self) -> None:
        phases, pins, leaps, rests = sequence_of(self.slider)
        for name, value in (("phases", phases), ("pins", pins), ("leaps", leaps), ("rests", np.array(rests))):
            object.__setattr__(self, name, value)

    phases: list[Phase] = field(init=False)
    pins: list[Pin] = field(init=False)
    leaps: list[Leap] = field(init=False)
    rests: Array = field(init=False)

    @property
    def never_slips(self) -> bool:
        """True if it sticks throughout, so that it keeps its offset."""
        return len(self.phases) == 1 and not self.phases[0].slip

    @property
    def _motion(self) -> Motion:
        return self.slider.motion

    @property
    def _count(self) -> int:
        return self._motion.lines.shape[1] - 1

    @cached_property
    def sticks(self) -> list[Phase]:
        """Its phases of stick."""
        return [each for each in self.phases if not each.slip]

    @cached_property
    def _slips(self) -> list[Phase]:
        return [each for each in self.phases if each.slip]

    @cached_property
    def stiffness(self) -> tuple[float, float]:
        """The stiffness of its spring, and its derivative by the parameter."""
        return self.slider.number("stiffness")

    @cached_property
    def modes(self) -> list[int]:
        """The mode of each phase: 1 or -1 in slip, 0 in stick, and where it has no force."""
        middle = np.array([0.5 * (each.start + each.end) for each in self.phases])
        pieces = np.maximum([each.piece for each in self.phases], 0)
        acts = self.slider.limit(middle, pieces, partial=False).value > 0.0
        return [each.slip * int(act) for each, act in zip(self.phases, acts, strict=True)]

    @cached_property
    def lines(self) -> NDArray[np.complex128]:
        """Lines of the force, shape (2K + 1,)."""
        (k, _), spectrum = self.stiffness, self._slip_spectra[0].copy()
        spectrum += k * self._stretched
        found = _doubled(spectrum)
        found[: self._count + 1] -= self._of_share(self.share.spring, self._motion.frequency * self.share.damper)
        return found

    @cached_property
    def slopes(self) -> NDArray[np.complex128]:
        """Derivatives of the lines by the parameter, with the motion constant, shape (K + 1,)."""
        (k, slope), kept, motion = self.stiffness, self._count + 1, self._motion
        spectrum = self._slip_spectra[1] + slope * self._stretched
        spectrum -= k * self.slider.drift[1] * self._moment
        found = _doubled(spectrum)[:kept]
        found -= self._of_share(0.0, motion.frequency * motion.faster * self.share.damper)
        for column, (_, _, by_parameter) in self._linked:
            found += by_parameter * column
        return found

    @cached_property
    def pairs(self) -> list[tuple[int, int, NDArray[np.complex128]]]:
        """The derivatives by its deflection at the same angle, and by that of its host; see `Pairs`."""
        own = np.zeros((2, 2 * self._count + 1), dtype=complex)
        own[0] = self.stiffness[0] * self._stuck[: 2 * self._count + 1]
        own[:, 0] -= self.share.spring, self.share.damper
        element, found = self.slider.element, [(self.slider.element.place, self.slider.element.place, own)]
        if self.has_host:
            found.append((element.place, element.host_place, self._slip_spectra[2:].copy()))
        return found

    @property
    def has_host(self) -> bool:
        """True if its limit depends on the force of a host at the same angle."""
        law = self.slider.slots.form.law
        return isinstance(law, Friction) and law.by == "normal"

    @cached_property
    def links(self) -> list[tuple[int, NDArray[np.complex128], Array]]:
        """The force, the column and the row of each link; see `Links`."""
        place, width, found = self.slider.element.place, len(self._motion.lines), []
        for column, (by_own, by_host, _) in self._linked:
            row = np.zeros((width, 2 * self._count + 1))
            row[place] += by_own
            if self.slider.element.host >= 0:
                row[self.slider.element.host_place] += by_host
            found.append((place, column, row.ravel()))
        return found

    @cached_property
    def _linked(self) -> list[tuple[NDArray[np.complex128], tuple[Array, Array, float]]]:
        """The column and the linear function of each link: of both deflections, and its derivative by the parameter."""
        k, kept, found = self.stiffness[0], self._count + 1, []
        for pin in sorted({each.pin for each in self.sticks}):
            own = [each for each in self.sticks if each.pin == pin]
            column = -k * _doubled(_indicators(own, self._count).sum(axis=0))
            found.append((column, self._row(self.change_of(self.pins[pin]))))
        for leap in self.leaps:
            phi = self.slider.breaks[leap.place].phi
            column = k * leap.change / TURN * _doubled(np.exp(-1j * phi * np.arange(kept)))
            found.append((column, self._row(self.shift_of(leap.place))))
        return found

    def _row(self, change: Change) -> tuple[Array, Array, float]:
        """Return a change as a function of the real forms of both deflections, and of the parameter."""
        k, w = np.arange(self._count + 1), self._motion.frequency
        if np.isnan(change.phi):  # the mean
            return np.eye(1, 2 * self._count + 1)[0], np.zeros(2 * self._count + 1), 0.0
        angle = k * change.phi
        value = np.concatenate((np.cos(angle), np.sin(angle[1:])))
        rate = w * np.concatenate((-k * np.sin(angle), (k * np.cos(angle))[1:]))
        return change.own * value, change.host * value + change.host_rate * rate, change.by_parameter

    def change_of(self, pin: Pin) -> Change:
        """Return the change of the place of the slider at a pin."""
        if not pin.side:
            return Change(np.nan, 1.0, 0.0, 0.0, 0.0)
        (k, slope), faster, at = self.stiffness, self.slider.drift[1], np.array([pin.phi])
        limit = self.slider.limit(at, np.array([pin.piece]))
        value, by_angle, by_parameter, by_deflection, by_rate = (pin.side / k * float(each[0]) for each in limit)
        found = Change(pin.phi, 1.0, by_deflection, by_rate, by_parameter - pin.phi * faster - value * slope / k)
        if pin.place < 0:
            return found
        shift, rate = self.shift_of(pin.place), float(self.slider.deflection_rate(at)[0]) + by_angle
        host, host_rate, more = (a + rate * b for a, b in zip(found[2:], shift[2:], strict=True))
        return Change(pin.phi, 1.0, host, host_rate, more)

    def shift_of(self, place: int) -> Change:
        """Return the change of the angle of a break."""
        each = self.slider.breaks[place]
        rate, limit = self.slider.moved(place)
        if limit is not None:
            _, _, by_parameter, by_deflection, by_rate = (float(part[0]) for part in limit)
            return Change(each.phi, 0.0, -by_deflection / rate, -by_rate / rate, -by_parameter / rate)
        stage = self._motion.layout.contacts[self.slider.element.host].stages[each.switch]
        wider = float(self._motion.slope[stage.clearance])
        return Change(each.phi, 0.0, -stage.sign / rate, 0.0, wider / rate)

    def _of_share(self, spring: float, damper: float) -> NDArray[np.complex128]:
        """Return the lines of a spring and a damper, whose coefficient is multiplied by the frequency."""
        own = self._motion.lines[self.slider.element.place]
        return (spring + 1j * damper * np.arange(len(own))) * own

    @cached_property
    def _stuck(self) -> NDArray[np.complex128]:
        """Spectrum of the function that is 1 in stick, k = 0 ... 3K."""
        return _indicators(self.sticks, 3 * self._count).sum(axis=0)

    @cached_property
    def _moment(self) -> NDArray[np.complex128]:
        """Spectrum of that function times phi, k = 0 ... 2K."""
        return _moments(self.sticks, 2 * self._count)

    @cached_property
    def _stretched(self) -> NDArray[np.complex128]:
        """Spectrum of the extension in stick, k = 0 ... 2K."""
        longest, own = 2 * self._count, self._motion.lines[self.slider.element.place]
        half = 0.5 * own[1:]
        function = np.concatenate((half[::-1].conj(), own[:1], half))
        both = np.concatenate((self._stuck[:0:-1].conj(), self._stuck))
        spectrum = np.convolve(both, function, "valid")[longest:]
        rests = self.rests[[each.pin for each in self.sticks]]
        spectrum -= rests @ _indicators(self.sticks, longest)
        if self.slider.drift[0]:
            spectrum -= self.slider.drift[0] * self._moment
        return spectrum

    @cached_property
    def _slip_spectra(self) -> NDArray[np.complex128]:
        """Spectra, k = 0 ... 2K, of the force in slip and its derivatives by the parameter, the host, and its rate."""
        longest, slips = 2 * self._count, self._slips
        signs, pieces = np.array([each.slip for each in slips]), np.array([each.piece for each in slips], dtype=np.intp)
        found: NDArray[np.complex128] = np.zeros((4, longest + 1), dtype=complex)
        if self.slider.is_steady:
            limit = self.slider.limit(np.zeros(len(slips)), pieces)
            both = signs * np.array([limit.value, limit.by_parameter])
            found[:2] = both @ _indicators(slips, longest)
        elif slips:
            nodes, weights, each = _gauss(slips, longest)
            limit = self.slider.limit(nodes, pieces[each])
            values = np.array([limit.value, limit.by_parameter, limit.by_deflection, limit.by_rate])
            found = (values * (signs[each] * weights)) @ waves(-nodes, longest) / TURN
        return found

    def _phases_at(self, phi: Array) -> NDArray[np.intp]:
        ends = np.array([each.end for each in self.phases])
        return np.minimum(np.searchsorted(ends, phi, side="right"), len(ends) - 1)

    def sticks_at(self, phi: Array) -> Array:
        """Return 1 where it sticks, otherwise 0."""
        return np.array([float(not each.slip) for each in self.phases])[self._phases_at(phi)]

    def tangents(self, phi: Array) -> Array:
        """Return the derivatives at some angles, in the order of `pairs`, shape (pairs, 2, angles)."""
        places = self._phases_at(phi)
        slips = np.array([each.slip for each in self.phases])[places]
        pieces = np.array([each.piece for each in self.phases], dtype=np.intp)[places]
        none = np.zeros(len(phi))
        own = self.stiffness[0] * (slips == 0) - self.share.spring, none - self.share.damper
        found = [np.array(own)]
        if self.has_host:
            limit = self.slider.limit(phi, pieces)
            found.append(slips * np.array([limit.by_deflection, limit.by_rate]))
        return np.array(found)

    def extension(self, phi: Array) -> Array:
        """Return the extension of its spring at some angles from 0 to 2 pi."""
        places = self._phases_at(phi)
        slips, pins, pieces = np.array([each[2:] for each in self.phases]).T
        rests = self.rests[pins[places]]  # in slip not used
        limit = self.slider.limit(phi, pieces[places], partial=False).value / self.stiffness[0]
        return np.where(slips[places] == 0, self.slider.deflection(phi) - rests, slips[places] * limit)

    @cached_property
    def breaks(self) -> Array:
        """The angles of all its events."""
        ends = [each.end for each in self.phases if each.end < TURN]
        return np.sort(np.concatenate((ends, [each.phi for each in self.slider.breaks])))


class Change(NamedTuple):
    """A linear function of the motion at an angle: of the own deflection, of the host, of its rate over time."""

    phi: float
    own: float
    host: float
    host_rate: float
    by_parameter: float


@dataclass(frozen=True, eq=False)
class Memory:
    """The forces of all Jenkins elements along a motion."""

    forces: tuple[DryForce, ...] = ()  #: That of each element, in the order of the contacts.

    def __len__(self) -> int:
        return len(self.forces)

    @cached_property
    def pairs(self) -> Pairs:
        """The derivatives by deflections at the same angle."""
        if not self.forces:
            return NO_PAIRS
        places, arguments, spectra = zip(*(pair for each in self.forces for pair in each.pairs), strict=True)
        return Pairs(np.array(places), np.array(arguments), np.array(spectra))

    @cached_property
    def links(self) -> Links:
        """The derivatives by the motion at single angles."""
        found = [link for each in self.forces for link in each.links]
        lines = self.forces[0].slider.motion.lines
        places, columns, rows = ([link[part] for link in found] for part in range(3))
        return Links(
            np.array(places, dtype=np.intp),
            np.array(columns, dtype=complex).reshape(len(found), lines.shape[1]),
            np.array(rows, dtype=float).reshape(len(found), len(lines) * (2 * lines.shape[1] - 1)),
        )

    def extensions(self, phi: Array) -> Array:
        """Return the extensions of all springs, shape (angles, elements)."""
        return np.array([each.extension(phi % TURN) for each in self.forces]).reshape(len(self.forces), -1).T

    @property
    def stuck(self) -> tuple[int, ...]:
        """Numbers of the contacts that never slip."""
        return tuple(each.slider.element.contact for each in self.forces if each.never_slips)

    def slips(self, period: int) -> tuple[SlipEvent, ...]:
        """Return the modes of all elements at the start of a motion of some forcing periods, and their changes."""
        found = []
        for each in self.forces:
            mode = None
            for phase, slip in zip(each.phases, each.modes, strict=True):
                if slip != mode:
                    found.append(SlipEvent(period * phase.start, each.slider.element.contact, slip))
                mode = slip
        return tuple(sorted(found))

    def with_kept(self, multipliers: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return multipliers with 1 for each element that never slips, in place of 0, largest first."""
        found, kept = multipliers.copy(), len(self.stuck)
        found[np.abs(found) <= _ROUNDING * max(1.0, float(np.abs(found).max()))] = 0.0
        found = np.append(found[: len(found) - kept], np.ones(kept, complex))
        return found[np.argsort(-np.abs(found), kind="stable")]


NO_MEMORY = Memory()
"""That of a system without Jenkins elements."""


def elements_in(layout: CoefficientLayout) -> list[Element]:
    """Return all Jenkins elements of a system."""
    structure, first = layout.structure, firsts_of(layout.structure)
    found = []
    for contact in structure.memories:
        host = structure.host(contact)
        found.append(
            Element(contact, first[contact], -1 if host is None else host, -1 if host is None else first[host])
        )
    return found


def check_dry(layout: CoefficientLayout) -> None:
    """Refuse friction that harmonic balance cannot include."""
    for slots in layout.contacts:
        law, name = slots.form.law, slots.form.name
        if not isinstance(law, Friction):
            continue
        if not law.has_memory:
            raise ModelError(
                f"harmonic balance cannot include {name!r}: its force law {law.name!r} sticks rigidly, and the force "
                "in stick is a reaction, which does not follow from the deflection. Give it a stiffness in series, "
                "which makes it a Jenkins element (stiffness = 100 beside limit or coefficient, in the units of the "
                "model), or use the method shooting"
            )


def _doubled(spectrum: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the lines of a spectrum k = 0, 1, ..."""
    found = np.asarray(2.0 * spectrum, dtype=np.complex128)
    found[0] = spectrum[0].real
    return found


def _indicators(phases: list[Phase], longest: int) -> NDArray[np.complex128]:
    """Return the spectrum, k = 0 ... longest, of the function that is 1 in each phase; shape (phases, longest + 1)."""
    start, end = (np.array([each[place] for each in phases], dtype=float) for place in (0, 1))
    found: NDArray[np.complex128] = np.empty((len(phases), longest + 1), dtype=complex)
    found[:, 0] = (end - start) / TURN
    difference = waves(-start, longest) - waves(-end, longest)
    found[:, 1:] = difference[:, 1:] / (1j * TURN * np.arange(1, longest + 1))
    return found


def _moments(phases: list[Phase], longest: int) -> NDArray[np.complex128]:
    """Return the spectrum, k = 0 ... longest, of the function that is phi in some phases, and 0 elsewhere."""
    start, end = (np.array([each[place] for each in phases], dtype=float) for place in (0, 1))
    found: NDArray[np.complex128] = np.empty(longest + 1, dtype=complex)
    found[0] = (end**2 - start**2).sum() / (2.0 * TURN)
    ends = start @ waves(-start, longest) - end @ waves(-end, longest)
    inner = _indicators(phases, longest).sum(axis=0)
    k = np.arange(1, longest + 1)
    found[1:] = ends[1:] / (1j * TURN * k) + inner[1:] / (1j * k)
    return found


def _gauss(phases: list[Phase], longest: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return nodes and weights of Gauss's rule on panels that resolve all lines, and the phase of each."""
    nodes, weights, numbers = [], [], []
    for number, each in enumerate(phases):
        count = 1 + int((each.end - each.start) * max(8, longest) / TURN)
        ends = each.start + (each.end - each.start) * np.arange(count + 1) / count
        half = 0.5 * np.diff(ends)[:, None]
        nodes.append((ends[:-1, None] + half * (1.0 + _NODES)).ravel())
        weights.append((half * _WEIGHTS).ravel())
        numbers.append(np.full(len(nodes[-1]), number))
    return np.concatenate(nodes), np.concatenate(weights), np.concatenate(numbers)
