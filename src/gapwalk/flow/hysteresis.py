"""Hysteresis: the loop of a contact's force under a harmonic deflection, and the energy that it dissipates."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.forces import Angles, contact_force, stages_of
from gapwalk.model.coefficients import CoefficientLayout, ContactSlots, coefficients_of, layout_of
from gapwalk.model.contact import Contact
from gapwalk.model.laws import Law
from gapwalk.model.structure import ContactForm
from gapwalk.model.system import System, check_system
from gapwalk.notebook import Pictured

_NODES, _WIDEST = 20, PERIOD / 8  # of Gauss's rule: between breakpoints the force is a trigonometric polynomial
_GRID, _HALVINGS = 4096, 52  # phases at which the modes of a law are compared, and bisections between two of them
_JUMP = 1e-9  # rad: distance from a breakpoint of the samples on both sides, which show a jump of the force


@dataclass(frozen=True, eq=False)
class Hysteresis(Pictured):
    """The force of a contact while its deflection is ``mean + amplitude * cos(theta)``, over one cycle.

    Examples
    --------
    >>> loop = gw.analysis.hysteresis(system, amplitude=1.2, frequency=1.0)
    >>> loop.contact, loop.force.shape, loop.breakpoints
    ('stop', (725,), (1.0,))
    """

    #: contact, law: Name of the contact, and its force law.
    contact: str
    law: Law
    #: amplitude, mean, frequency: Amplitude, mean and angular frequency of the deflection.
    amplitude: float
    mean: float
    frequency: float
    breakpoints: tuple[float, ...]  #: Deflections at which a stage opens or closes, increasing.
    #: theta, deflection, rate, force: shape (samples,): Phase in radians, deflection, its rate, and the force.
    theta: NDArray[np.float64]
    deflection: NDArray[np.float64]
    rate: NDArray[np.float64]
    force: NDArray[np.float64]
    #: Energy dissipated per cycle, the area of the loop: ``integral of f dx``. Negative if the law feeds energy in.
    loss: float

    @property
    def equivalent_damping(self) -> float:
        """Viscous damping with the same loss: ``loss / (pi W amplitude^2)``.

        It is the damping of the describing function, so it does not depend on the frequency.
        """
        return self.loss / (math.pi * self.frequency * self.amplitude**2)


def hysteresis(
    system: System | Contact,
    amplitude: float,
    contact: str | None = None,
    *,
    mean: float = 0.0,
    frequency: float | None = None,
    samples: int = 720,
) -> Hysteresis:
    """Compute the loop of force over deflection of a contact under a harmonic deflection (paper, figure 1).

    Parameters
    ----------
    system
        A system, or a contact alone.
    amplitude, mean
        Amplitude and mean of the deflection ``mean + amplitude * cos(theta)``.
    contact
        Name of the contact; optional if there is only one.
    frequency
        Angular frequency; by default that of the system (1 for a contact alone).
    samples
        Samples of the loop.

    Returns
    -------
    Hysteresis
        The loop, and its loss.

    Raises
    ------
    ModelError
        If there is no such contact, its force depends on several deflections, or an amplitude or a frequency is not
        valid.

    Notes
    -----
    Numbers that vary over the angle of the excitation have their mean values, and no displacement is added.

    Examples
    --------
    >>> round(gw.analysis.hysteresis(system, amplitude=1.2, frequency=1.0).loss, 6)
    0.058052
    """
    if isinstance(system, Contact):  # a system of one coordinate, its deflection
        alone = replace(system, deflection={"x": 1.0}, force=None)
        system = System(("x",), [[0.0]], contacts=[alone])
    check_system(system, "hysteresis")
    name, form, slots = pick_contact(system, contact)
    frequency = system.frequency if frequency is None else frequency
    for what, value in (("amplitude", amplitude), ("frequency", frequency)):
        if not 0.0 < value < math.inf:
            raise ModelError(f"{what} is {value!r}; it must be a number > 0")
    if not math.isfinite(mean):
        raise ModelError(f"mean is {mean!r}; it must be a finite number")
    if slots.deflections[1:]:
        raise ModelError(
            f"{name!r} depends on {len(slots.deflections)} deflections ({', '.join(form.law.arguments)}), so it has no "
            "loop over one of them; plot the loop of a motion, as in gw.plot.draw(orbit.motion(), contact=...)"
        )
    if form.law.is_dry or form.law.rebounds:
        raise ModelError(
            f"{name!r} is {form.law.words}: its force depends on what happened before, or is an impulse, so it has no "
            "loop by itself; draw that of a motion: gw.plot.draw(gw.analysis.stick_slip(orbit)), and its loss is in "
            "gw.analysis.energy(orbit)"
        )
    layout = layout_of(system.structure)
    coefficients = steady(layout, coefficients_of(system))
    levels = sorted({stage.sign * float(coefficients[stage.clearance]) for stage in slots.stages})
    met = [math.acos((level - mean) / amplitude) for level in levels if abs(level - mean) < amplitude]

    def moved(theta: NDArray[np.float64]):
        x, rate = mean + amplitude * np.cos(theta), -amplitude * frequency * np.sin(theta)
        return x, rate, Angles(layout, coefficients, np.zeros_like(theta))

    def cycle(theta: NDArray[np.float64]):
        x, rate, angles = moved(theta)
        return x, rate, contact_force(slots, angles, [(x, rate)])

    def modes(theta: NDArray[np.float64]) -> NDArray[np.bool_]:
        x, rate, angles = moved(theta)
        found = stages_of(slots, angles, [(x, rate)]).modes
        return np.stack([np.broadcast_to(each, theta.shape) for each in found]) > 0.0

    kinks = _changes(modes) if form.law.mode_count else []
    edges = np.array(sorted({0.0, PERIOD, *met, *(PERIOD - angle for angle in met), *kinks}))
    nodes, weights = _nodes(edges)
    _, rate, force = cycle(nodes)
    loss = float(weights @ (force * rate)) / frequency
    inner = edges[1:-1]
    theta = np.unique(np.concatenate((np.linspace(0.0, PERIOD, samples + 1), inner - _JUMP, inner + _JUMP)))
    x, rate, force = cycle(theta)
    return Hysteresis(name, form.law, amplitude, mean, frequency, tuple(levels), theta, x, rate, force, loss)


def _changes(modes: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> list[float]:
    """Return the phases of a cycle at which the modes of a law change, by bisection."""
    theta = np.linspace(0.0, PERIOD, _GRID + 1)
    states = modes(theta)
    which, places = np.nonzero(states[:, 1:] != states[:, :-1])
    low, high, before = theta[places], theta[places + 1], states[which, places]
    for _ in range(_HALVINGS if len(which) else 0):
        middle = 0.5 * (low + high)
        same = modes(middle)[which, np.arange(len(which))] == before
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return high.tolist()


def steady(layout: CoefficientLayout, coefficients: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients of a system whose numbers do not vary over the angle: they have their mean values."""
    found = coefficients.copy()
    for slots in layout.contacts:
        for waves in (slots.waves, *(stage.waves for stage in slots.stages)):
            for wave in waves.values():
                found[wave.lines] = 0.0
    for cycle in layout.cycles:
        found[[cycle.low, cycle.high]] = 0.0
    return found


def pick_contact(system: System, name: str | None) -> tuple[str, ContactForm, ContactSlots]:
    """Return the contact of a name, or the only one: its name, form and coefficient slots; else a ModelError."""
    known = [form.name for form in system.structure.contacts]
    if name is None and len(known) == 1:
        name = known[0]
    if name not in known:
        given = "no contact is named" if name is None else f"there is no contact {name!r}"
        raise ModelError(f"{given}; contacts are {', '.join(known) or 'none at all'}")
    place = known.index(name)
    return name, system.structure.contacts[place], layout_of(system.structure).contacts[place]


def _nodes(edges: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return nodes and weights of Gauss's rule between the edges."""
    knots = [np.linspace(a, b, 2 + int((b - a) / _WIDEST))[:-1] for a, b in pairwise(edges)]
    starts = np.append(np.concatenate(knots), edges[-1])
    widths, (nodes, weights) = np.diff(starts), leggauss(_NODES)
    return (starts[:-1, None] + 0.5 * widths[:, None] * (nodes + 1.0)).ravel(), np.outer(0.5 * widths, weights).ravel()
