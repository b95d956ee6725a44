"""A signal of a motion: a coordinate, velocity, acceleration or contact force, or a sum of several with factors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.dry_motion import forces_and_accelerations, is_dry
from gapwalk.flow.motion import Motion, signal_factor, signal_place, train_histories, train_signals
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System

_STEP = 1e-150  # of the complex step, as in `gapwalk.model.coefficients`


@dataclass(frozen=True)
class Signal:
    """A sum of signals with factors, as a sensor measures it.

    Examples
    --------
    >>> gw.measure.Signal((("x''", 1.0), ("x", -2.0))).of(orbit.motion(8)).shape
    (9,)
    """

    terms: tuple[tuple[str, float], ...]  #: Names as in `Motion.signal`, each with its factor.
    label: str = ""  #: Label of the signal; by default the sum as a text.

    @property
    def name(self) -> str:
        """Label, or the sum as a text: ``q1''``, or ``0.5 q1'' - 2 q3``."""
        if self.label:
            return self.label
        if len(self.terms) == 1 and self.terms[0][1] == 1.0:
            return self.terms[0][0]
        text = " ".join(f"{'-' if factor < 0 else '+'} {_size(factor)}{name}" for name, factor in self.terms)
        return text.removeprefix("+ ").replace("- ", "-", 1) if text.startswith("- ") else text.removeprefix("+ ")

    def of(self, motion: Motion) -> NDArray[np.float64]:
        """Return its values along a motion, shape (samples,).

        Returns
        -------
        array, shape (samples,)
            The sum.
        """
        return np.sum([factor * motion.signal(name) for name, factor in self.terms], axis=0)

    def slope(
        self,
        motion: Motion,
        states: NDArray[np.float64],
        coefficients: NDArray[np.float64] | None = None,
        theta: float = 0.0,
    ) -> NDArray[np.float64]:
        """Return its derivative along a direction, exact to rounding, shape (samples,).

        The modes of dry friction are those of the motion: events at which a signal jumps are not moved.

        Parameters
        ----------
        motion
            The motion.
        states : shape (samples, state_size)
            Derivatives of positions, velocities and extensions along that direction.
        coefficients
            Derivatives of the coefficients of the flow; None if they are constant.
        theta
            Derivative of the angle of the excitation.

        Returns
        -------
        array, shape (samples,)
            In the unit of the signal.
        """
        system, layout, step = motion.system, layout_of(motion.system.structure), 1j * _STEP
        n = system.size
        q, v = motion.q + step * states[:, :n], motion.v + step * states[:, n : 2 * n]
        numbers = coefficients_of(system) + step * (0.0 if coefficients is None else coefficients)
        angles = motion.theta + step * theta
        z = motion.z + step * states[:, 2 * n :]
        modes = motion.modes if is_dry(system.structure) else None
        forces, a = forces_and_accelerations(layout, numbers, angles, q, v, z, modes)
        columns = [q, v, a, forces, z, *([] if modes is None else [modes.slips])]
        if of_train := train_signals(system.structure):
            if coefficients is not None and any(name in of_train for name, _ in self.terms):
                raise ModelError(
                    f"the slope of {self.name} by a parameter is not known: it depends on the parts of the train "
                    "themselves; fit to a coordinate, or to its acceleration"
                )
            columns.append(train_histories(system, angles, q, v, a, forces))
        everything: NDArray[np.complex128] = np.hstack(columns)
        shifted = everything.imag / _STEP
        factors = [(signal_place(system, name), factor * signal_factor(system, name)) for name, factor in self.terms]
        return np.sum([factor * shifted[:, place] for place, factor in factors], axis=0)


def signal_of(system: System, given: str | Mapping[str, float] | Signal) -> Signal:
    """Return a signal of a system's motions from its name, or from names with factors."""
    if isinstance(given, str):
        terms = ((given, 1.0),)
    else:
        terms = given.terms if isinstance(given, Signal) else tuple(given.items())
    for name, factor in terms:
        signal_place(system, name)
        if isinstance(factor, bool) or not isinstance(factor, int | float) or not math.isfinite(factor):
            raise ModelError(f"the factor of {name} is {factor!r}; it must be a finite number")
    if not any(factor for _, factor in terms):
        raise ModelError("a signal names at least one of the system's, as in \"q1''\" or { \"q1''\" = 1.0 }")
    return given if isinstance(given, Signal) else Signal(terms)


def contact_to_show(system: System, signal: str, forces: NDArray[np.float64]) -> int:
    """Return the place of the contact whose force a picture shows by default.

    It is the one that the signal names. Otherwise it is a contact that touches, if possible one that acts on the
    signal's coordinate, and of these the one with the largest force.

    Shapes: `forces` (contacts,).
    """
    base, coordinates, sizes = signal.rstrip("'"), system.coordinates, np.nan_to_num(forces)

    def rank(place: int) -> tuple[bool, bool, bool, float]:
        form, size = system.structure.contacts[place], float(sizes[place])
        own = base in coordinates and any(system.vector(each)[coordinates.index(base)] for each in form.vectors)
        return base.partition(".")[0] == form.name, size > 0.0, own, size

    return max(range(len(sizes)), key=rank)


def _size(factor: float) -> str:
    return "" if abs(factor) == 1.0 else f"{abs(factor):g} "
