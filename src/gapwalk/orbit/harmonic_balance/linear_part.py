"""The matrices of the linear part of the equations of motion, read from the coefficients of the flow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.structure import Structure

LOOSE = 1e10
"""Condition number of the stiffness beyond which only contacts restrain the system."""

_PART = 0.5  # size of a share, relative to the inertia


@dataclass(frozen=True, eq=False, slots=True)
class Linear:
    """The matrices of the equations of motion, or their derivatives by a parameter.

    A force by a formula may depend on several deflections. It acts with the first of them, with the others no force.
    """

    #: stiffness, damping: shape (n, n): A and B.
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    contacts: NDArray[np.float64]  #: shape (n, deflections): The D_k.
    #: shape (n, orders + 1): The constant load, and the complex amplitudes of each order of the excitation.
    loads: NDArray[np.complex128]
    deflections: NDArray[np.float64]  #: shape (deflections, n): The e_k.
    #: shape (deflections, orders + 1): The displacements u_k that are added to the deflections: complex amplitudes of
    #: each order, after a zero.
    sways: NDArray[np.complex128]

    def shifted(self, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add a share of the stiffness of each contact to the stiffness matrix, shape (n, n)."""
        return self.stiffness + (self.contacts * shift) @ self.deflections

    def pushed(self, shift: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the loads beside that share: it acts on the coordinates, but its forces are those of deflections."""
        return self.loads - (self.contacts * shift) @ self.sways

    @property
    def is_zero(self) -> bool:
        """True if all entries are zero: as derivatives, nothing changes with the parameter."""
        return not any(
            part.any()
            for part in (self.stiffness, self.damping, self.contacts, self.loads, self.deflections, self.sways)
        )


def linear_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> Linear:
    """Read the matrices from a vector of coefficients (or of their derivatives)."""
    n, contacts, orders = layout.structure.size, len(layout.contacts), len(layout.orders)
    table = coefficients[layout.accelerations]
    mean = 2 * n + contacts
    cosines, sines = table[:, mean + 1 : mean + 1 + orders], table[:, mean + 1 + orders :]
    loads: NDArray[np.complex128] = np.hstack((table[:, mean : mean + 1].astype(complex), cosines - 1j * sines))
    first = firsts_of(layout.structure)
    vectors = [vector for slots in layout.contacts for vector in slots.deflections]
    deflections = np.array([coefficients[vector] for vector in vectors]).reshape(len(vectors), n)
    pushes, sways = np.zeros((n, len(vectors))), np.zeros((len(vectors), orders + 1), dtype=complex)
    pushes[:, first] = table[:, 2 * n : mean]
    for place, slots in zip(first, layout.contacts, strict=True):
        for number, name in enumerate(slots.form.law.arguments):
            if (wave := slots.waves.get(name)) is not None:
                lines = coefficients[wave.lines]
                sways[place + number, 1:] = lines[:orders] - 1j * lines[orders:]
    return Linear(table[:, :n], table[:, n : 2 * n], pushes, loads, deflections, sways)


class Share(NamedTuple):
    """A spring and a damper that are moved from a force by a formula, or by friction, into the linear part.

    Without them, a system that only these forces hold or damp would have a resonance in its linear part.
    """

    place: int  #: Number of the deflection on which they act.
    #: spring, damper: Their coefficients.
    spring: float
    damper: float


@dataclass(frozen=True, eq=False)
class ForcesLessShares:
    """Forces of some contacts less their shares, for some coefficients of the flow and their derivatives."""

    #: layout, coefficients, slope: The coefficients, and their derivatives by a parameter.
    layout: CoefficientLayout
    coefficients: NDArray[np.float64]
    slope: NDArray[np.float64]
    shares: tuple[Share, ...] = ()  #: What is taken away from the forces.


def shares_of(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> tuple[Share, ...]:
    """Choose the shares of forces without stages: dampers, and springs if the stiffness does not hold the system.

    They are about as large as the inertia of the deflection at the frequency of the excitation.
    """
    linear, frequency, found = linear_of(layout, coefficients), 1.0 / float(coefficients[0]), []
    is_held = np.linalg.cond(linear.stiffness, 1) < LOOSE
    for place, slots in zip(firsts_of(layout.structure), layout.contacts, strict=True):
        inverse = float(linear.deflections[place] @ linear.contacts[:, place])  # of the mass that is moved
        if not slots.form.law.stage_parameters and inverse > 0.0:
            spring = 0.0 if is_held else _PART * frequency**2 / inverse
            found.append(Share(place, spring, _PART * frequency / inverse))
    return tuple(found)


def shared(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    slope: NDArray[np.float64] | None,
    shares: tuple[Share, ...],
) -> tuple[Linear, Linear | None]:
    """Return the linear part with shares of formulas, and its derivative by a parameter.

    Displacements that are prescribed in a deflection act on its spring and damper as loads.
    """
    linear, change = linear_of(layout, coefficients), None if slope is None else linear_of(layout, slope)
    frequency = 1.0 / float(coefficients[0])
    orders = np.array([0, *layout.orders])
    for place, spring, damper in shares:
        push, vector, sway = linear.contacts[:, place], linear.deflections[place], linear.sways[place]
        along: NDArray[np.float64] = push[:, None] * vector
        factors = spring + 1j * orders * frequency * damper
        if change is not None and slope is not None:
            pushed, moved, swayed = change.contacts[:, place], change.deflections[place], change.sways[place]
            turned: NDArray[np.float64] = pushed[:, None] * vector + push[:, None] * moved
            faster = -1j * orders * damper * frequency**2 * float(slope[0])
            loads = np.outer(pushed, factors * sway) + np.outer(push, faster * sway + factors * swayed)
            change = _with(change, spring * turned, damper * turned, loads)
        linear = _with(linear, spring * along, damper * along, np.outer(push, factors * sway))
    return linear, change


def _with(
    linear: Linear, stiffness: NDArray[np.float64], damping: NDArray[np.float64], loads: NDArray[np.complex128]
) -> Linear:
    """Add to the matrices of stiffness and damping, and subtract from the loads."""
    return replace(
        linear, stiffness=linear.stiffness + stiffness, damping=linear.damping + damping, loads=linear.loads - loads
    )


def firsts_of(structure: Structure) -> list[int]:
    """Return the number of the first deflection of each contact, of those of all contacts one after the other."""
    counts = [len(form.law.arguments) for form in structure.contacts]
    return [*accumulate(counts, initial=0)][:-1]


def deflections_in(structure: Structure) -> int:
    """Return the number of deflections of all contacts: one for each argument of their laws."""
    return sum(len(form.law.arguments) for form in structure.contacts)
