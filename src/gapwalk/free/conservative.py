"""The system without damping and excitation, its energy, and the test that its motions run backwards."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import FlowError, ModelError
from gapwalk.flow.dry_motion import is_dry
from gapwalk.flow.flow import PERIOD, flow_of
from gapwalk.free.undriven import amplitudes_of, check_constant
from gapwalk.model.coefficients import coefficients_of, static_load
from gapwalk.model.gyroscopic import gyroscopic_part
from gapwalk.model.spring import springs_of
from gapwalk.model.static_force import static_forces_of
from gapwalk.model.system import System

_LOSSES = ("impact_damping", "viscous_damping")  # numbers of contacts that are set to zero
_BACK = 1e-7  # largest difference of a motion that ran forward and back, relative to it


def without_losses(system: System) -> System:
    """Return a system without damping and without excitation: its mean loads remain, and its gyroscopic terms.

    A drive train becomes the system of its equations of motion.

    Parameters
    ----------
    system
        The system.

    Returns
    -------
    System
        The same system with other numbers.

    Raises
    ------
    ModelError
        For a system with dry friction or rigid stops, or with a force that depends on rates in another way, or if its
        gyroscopic terms cannot be told from losses.

    Examples
    --------
    >>> import gapwalk as gw
    >>> free = gw.free.without_losses(gw.paper.case("13"))
    >>> free["damping.q1.q1"], free["harmonic1.amplitude"]
    (0.0, 0.0)
    """
    if is_dry(system.structure):
        raise ModelError(
            "a system with dry friction or rigid stops has no free vibration without losses; leave them out, or "
            "replace a rigid stop by a stiff one"
        )
    check_constant(system)
    plain = system.equations
    structure, names = plain.structure, plain.coordinates
    zero = [f"{form.name}.{loss}" for form in structure.contacts for loss in _LOSSES]
    kept = gyroscopic_part(plain, plain.matrix("stiffness"), plain.matrix("damping"))
    turning = damping_values(plain, np.zeros((len(names), len(names))) if kept is None else kept)
    none = {name: 0.0 for name in (*zero, *amplitudes_of(plain)) if name in structure.names}
    free = plain.at({**none, **turning})
    _check_reversible(free)
    return free


def damping_values(system: System, damping: NDArray[np.float64]) -> dict[str, float]:
    """Return the values of the parameters that make up a damping matrix."""
    names = system.coordinates
    return {f"damping.{a}.{b}": float(damping[i, k]) for i, a in enumerate(names) for k, b in enumerate(names)}


def _check_reversible(system: System) -> None:
    """Refuse a system whose motions do not run backwards, by running one: that shows any loss, whatever its law.

    Gyroscopic terms turn with the motion.
    """
    flow, coefficients = flow_of(system), coefficients_of(system)
    turned = coefficients_of(system.at(damping_values(system, -system.matrix("damping"))))
    size = 2.0 * max((slope.clearance for spring in springs_of(system) for slope in spring.slopes), default=1.0) or 1.0
    start = np.zeros(2 * system.size)
    start[: system.size] = size * np.linspace(1.0, 0.7, system.size)
    turn = np.repeat([1.0, -1.0], system.size)
    try:
        there = flow.integrate(coefficients, start, 0.0, PERIOD).state
        back = flow.integrate(turned, turn * there, 0.0, PERIOD).state * turn
    except FlowError:
        return
    unit = system.state_scales()
    if np.abs((back - start) / unit).max() > _BACK * max(np.abs(start / unit).max(), np.abs(there / unit).max()):
        raise ModelError(
            "the motions of this system without damping and excitation do not run backwards: a force depends on rates, "
            "or a number varies over the angle; take it out of the model, such as a formula with v"
        )


def potential_of(system: System, positions: NDArray[np.float64]) -> float:
    """Return the potential energy at some positions, relative to zero positions, in the units of the model.

    The forces of contacts are integrated along the straight line from zero, piece by piece between breakpoints. It is
    nan if the stiffness matrix is not symmetric or a contact acts along another vector than its deflection: then the
    equations were multiplied by something, and do not show their energy.
    """
    if not shows_energy(system):
        return float("nan")
    total = 0.5 * float(positions @ system.matrix("stiffness") @ positions) - float(static_load(system) @ positions)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for force, spring in zip(static_forces_of(system), springs_of(system), strict=True):
        along = force.deflections @ positions
        places = {0.0, 1.0}
        edges = [slope.sign * slope.clearance / along[0] for slope in spring.slopes if along[0] != 0.0]
        places |= {edge for edge in edges if 0.0 < edge < 1.0}
        ordered = sorted(places)
        for low, high in pairwise(ordered):
            shares = low + (high - low) * 0.5 * (nodes + 1.0)
            forces = force.by_deflections(np.outer(shares, along)).force
            total += 0.5 * (high - low) * float(weights @ forces) * float(force.direction @ positions)
    return total


def shows_energy(system: System) -> bool:
    """Return True if the equations of a system show its energy: they were not multiplied by anything."""
    stiffness = system.matrix("stiffness")
    symmetric = np.allclose(stiffness, stiffness.T, rtol=1e-12, atol=1e-12 * np.abs(stiffness).max(initial=0.0))
    forces = static_forces_of(system)
    return symmetric and all(
        len(each.deflections) == 1 and np.allclose(each.direction, each.deflections[0]) for each in forces
    )
