"""Forces by formulas along a motion given by its lines: sampled, with as many samples as make aliasing negligible.

The force ``f(x_1, x_1', x_2, ..., theta)`` of a formula is no polynomial, and has no spectrum in closed form. If it is
analytic, its lines decrease exponentially, and so do the errors of sampling. The number of samples is doubled until the
upper half of the resolved lines, of the force and of its derivatives, is below 1e-13 of the largest one: the lines that
are folded down are smaller still. The derivatives by each deflection and by each rate come from a complex step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.forces import Angles, contact_force
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots
from gapwalk.orbit.harmonic_balance.linear_part import firsts_of

_STEP = 1e-150  # of the complex step
_FOLDED = 1e-13  # largest line of the upper half, relative to the largest one
_TINY = 1e-300
_FEWEST = 64
_MOST = 1 << 15  # samples; for more than 512 lines, 64 for each line


class Pairs(NamedTuple):
    """The derivatives of forces by formulas along a motion, by each deflection that they depend on, and its rate.

    Attributes
    ----------
    forces, arguments : shape (pairs,)
        Number of the deflection with which the force acts, and of the one that it depends on.
    spectra : shape (pairs, 2, 2K + 1)
        Spectra, k = 0 ... 2K, of the derivative by the deflection and of that by its rate.
    """

    forces: NDArray[np.intp]
    arguments: NDArray[np.intp]
    spectra: NDArray[np.complex128]


class Sampled(NamedTuple):
    """Lines of the forces by formulas.

    Attributes
    ----------
    places : shape (formulas,)
        Number of the deflection with which each acts.
    lines : shape (formulas, 2K + 1)
        The lines k = 0 ... 2K.
    slopes : shape (formulas, K + 1)
        Their derivatives by the parameter, with the motion constant.
    pairs
        The derivatives by the motion.
    """

    places: NDArray[np.intp]
    lines: NDArray[np.complex128]
    slopes: NDArray[np.complex128]
    pairs: Pairs


@dataclass(frozen=True, eq=False)
class Formulas:
    """The forces by formulas, for some coefficients of the flow and their derivatives by a parameter.

    Parameters
    ----------
    layout, coefficients, slope
        The coefficients, and their derivatives.
    """

    layout: CoefficientLayout
    coefficients: NDArray[np.float64]
    slope: NDArray[np.float64]

    def sample(self, lines: NDArray[np.complex128], period: int) -> Sampled:
        """Compute the lines of all forces along deflections with some lines, shape (deflections, K + 1).

        Raises
        ------
        NumericalError
            If a formula has no value along the motion, or is not resolved by the largest number of samples.
        """
        places, found, slopes, pairs = [], [], [], []
        for place, slots in formulas_in(self.layout):
            spectra = self._resolved(slots, lines[place : place + len(slots.deflections)], period)
            count = lines.shape[1] - 1
            spectra[:2, 1:] *= 2.0
            places.append(place)
            found.append(spectra[0])
            slopes.append(spectra[1, : count + 1])
            pairs += [
                (place, place + each, spectra[2 + 2 * each : 4 + 2 * each]) for each in range(len(slots.deflections))
            ]
        forces, arguments, derivatives = zip(*pairs, strict=True)
        several = Pairs(np.array(forces), np.array(arguments), np.array(derivatives))
        return Sampled(np.array(places), np.array(found), np.array(slopes), several)

    def tangents(self, lines: NDArray[np.complex128], phi: NDArray[np.float64], period: int) -> NDArray[np.float64]:
        """Return the derivatives at some angles, shape (pairs, 2, angles): by each deflection, and by its rate."""
        wave = np.exp(1j * np.multiply.outer(np.arange(lines.shape[1]), phi))
        rate = 1j * np.arange(lines.shape[1]) / (period * self.coefficients[0])
        found = []
        for place, slots in formulas_in(self.layout):
            own = lines[place : place + len(slots.deflections)]
            values = self._values(slots, (own @ wave).real, ((own * rate) @ wave).real, period * phi)
            found.append(values[2:].reshape(-1, 2, len(phi)))
        return np.concatenate(found)

    def _resolved(self, slots: ContactSlots, lines: NDArray[np.complex128], period: int) -> NDArray[np.complex128]:
        """Return spectra of the force, of its derivative by the parameter, and of those by each deflection and rate."""
        count = lines.shape[1] - 1
        rates = lines * (1j * np.arange(count + 1) / (period * self.coefficients[0]))
        samples = max(_FEWEST, 1 << (8 * count - 1).bit_length())
        while True:
            x, v = (np.fft.irfft(_halved(each) * samples, samples) for each in (lines, rates))
            theta = 2.0 * np.pi * period * np.arange(samples) / samples
            spectra = np.fft.rfft(self._values(slots, x, v, theta)) / samples
            sizes = np.abs(spectra)
            # each derivative counts by the force that belongs to a change as large as the motion
            weights = np.array([1.0, 0.0, *np.abs(np.stack((x, v), axis=1)).max(axis=2).ravel()])
            largest, folded = (weights * each.max(axis=1) for each in (sizes, sizes[:, samples // 4 :]))
            unresolved = folded.max() / max(largest.max(), _TINY)
            if unresolved <= _FOLDED:
                return spectra[:, : 2 * count + 1].copy()
            if samples >= max(_MOST, 64 * count):
                raise NumericalError(
                    f"{samples} samples leave {unresolved:.2g} of the force {slots.form.name!r} unresolved; its formula "
                    "changes too fast for harmonic balance: use the method shooting"
                )
            samples *= 2

    def _values(
        self, slots: ContactSlots, x: NDArray[np.float64], v: NDArray[np.float64], theta: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the force, its derivative by the parameter, and those by each deflection and rate, at some angles."""
        moves, stepped = list(zip(x, v, strict=True)), 1j * _STEP
        angles = theta if slots.waves else 0.0
        known = Angles(self.layout, self.coefficients, angles)
        # over time, the rate is that over theta times the frequency, which may be the parameter
        faster = -stepped * self.slope[0] / self.coefficients[0]
        with np.errstate(all="ignore"):
            moved = Angles(self.layout, self.coefficients + stepped * self.slope, angles)
            found = [contact_force(slots, moved, [(x, v * (1.0 + faster)) for x, v in moves])]
            for place, (deflection, rate) in enumerate(moves):
                for beside in ((deflection + stepped, rate), (deflection, rate + stepped)):
                    found.append(contact_force(slots, known, [*moves[:place], beside, *moves[place + 1 :]]))
        values = np.array([np.broadcast_to(each, x.shape[1:]) for each in found], dtype=complex)
        result = np.concatenate((values[:1].real, values.imag / _STEP))
        if not np.isfinite(result).all():
            raise NumericalError(f"the formula of the force {slots.form.name!r} has no value along the motion")
        return result


def formulas_in(layout: CoefficientLayout) -> list[tuple[int, ContactSlots]]:
    """Return each force by a formula, after the number of the deflection with which it acts."""
    contacts = zip(firsts_of(layout.structure), layout.contacts, strict=True)
    return [(place, slots) for place, slots in contacts if not slots.form.law.stage_parameters]


def check_formulas(layout: CoefficientLayout, backend: str) -> None:
    """Refuse a formula whose lines decrease too slowly to be sampled, with the reason."""
    for _, slots in formulas_in(layout):
        name = f"{backend} cannot include {slots.form.name!r}: "
        if slots.form.law.mode_count:
            raise ModelError(
                f"{name}its formula has a kink, at abs, min or max, so that its lines decrease too slowly to be sampled; "
                "use the method shooting"
            )
        if any(wave.cycles for wave in slots.waves.values()):
            raise ModelError(f"{name}a number of its formula jumps over the angle; write its harmonics instead")


def _halved(lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the spectra, k = 0 ... K, of lines."""
    spectra = 0.5 * lines
    spectra[:, 0] *= 2.0
    return spectra


NO_PAIRS = Pairs(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros((0, 2, 1), complex))
"""The pairs of a system without formulas."""
