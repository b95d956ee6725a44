"""Motions in which a part floats within its clearance: only an open contact restrains it, so they are not isolated.

A loose gear on a bearing that has drag, but no stiffness, is restrained by its mesh alone. While the mesh rattles, its
motion is an isolated orbit like any other. A motion in which the mesh touches nowhere, however, may be shifted within
the clearance: the orbits form a family at each value of a parameter, and a multiplier is exactly 1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.static_force import StaticForce, formulas_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

_NOTHING = 1e-12  # share of the largest singular value of the stiffness below which one is zero up to rounding
_FEW, _MANY = 16, 256  # samples of an orbit, per forcing period, at which formulas are evaluated
_TOUCHES = 1e-8  # smallest depth, as a share of a clearance, at which a contact restrains anything
_LOOSE = (0, 1)  # phases of `Orbit.held` of a stop on which the motion never rests


def unheld(system: System) -> NDArray[np.float64]:
    """Return the directions in which the stiffness matrix has no spring, orthonormal, shape (n, ways).

    There, only contacts and formulas can restrain the system.
    """
    _, sizes, rows = np.linalg.svd(system.matrix("stiffness"))
    return rows[sizes <= _NOTHING * sizes[0]].T


def floats(orbit: Orbit, ways: NDArray[np.float64]) -> str:
    """Return the reason why an orbit is not isolated, but one of a family, with advice; empty if it is isolated.

    Shapes: `ways` (n, ways).
    """
    if not ways.shape[1]:
        return ""
    system, touching, opened = orbit.system, [], []
    depths = list(zip(system.breakpoints, orbit.turning_depths, strict=True))
    formulas = formulas_of(system)
    if any(_are_held(formulas, orbit, ways, samples) for samples in (_FEW, _MANY)):
        return ""
    held = [_held(each, orbit, _MANY) @ ways for each in formulas]
    for place, contact in enumerate(system.structure.contacts):
        if not contact.stages:
            continue
        deflection = system.vector(f"{contact.name}.deflection")
        if np.abs(deflection @ ways).max() <= _NOTHING * np.abs(deflection).max():
            continue
        own = [(switch, each[2], turns.values) for switch, (each, turns) in enumerate(depths) if each[0] == place]
        # what stays beyond a breakpoint is pressed there, however stiff the stage is
        closed = any(
            orbit.held.get(switch, _LOOSE) != _LOOSE or not values or min(values) > 0.0 or max(values) > _TOUCHES * gap
            for switch, gap, values in own
        )
        (touching if closed else opened).append((contact.name, deflection @ ways))
    rows = np.vstack([*held, *(row for _, row in touching), np.zeros_like(ways[:0])])
    if np.linalg.matrix_rank(rows) == ways.shape[1]:
        return ""
    advice = "give it a stiffness, however small, or begin where the contact closes"
    if isinstance(assembly := system.structure.assembly, TrainAssembly):
        deflections = assembly.numbers(system.values).deflections @ ways
        for link, moved in zip(assembly.form.links, deflections, strict=True):
            if link.drag and np.abs(moved).max() > _NOTHING:
                advice = f"give {link.name} a stiffness, however small, or begin where the contact closes"
                break
    if not opened:
        return f"no spring restrains it in some direction, so each such motion is one of a family; {advice}"
    names = " and ".join(name for name, _ in opened)
    return (
        f"{names} {'touch' if opened[1:] else 'touches'} nowhere, and no other spring restrains the floating part: it "
        f"may lie anywhere within its clearance, so each such motion is one of a family; {advice}"
    )


def _are_held(formulas: Sequence[StaticForce], orbit: Orbit, ways: NDArray[np.float64], samples: int) -> bool:
    """Return True if formulas alone restrain the system in all these directions."""
    rows = [_held(each, orbit, samples) @ ways for each in formulas]
    return bool(rows) and np.linalg.matrix_rank(np.vstack(rows)) == ways.shape[1]


def _held(formula: StaticForce, orbit: Orbit, samples: int) -> NDArray[np.float64]:
    """Return the vectors along which a formula restrains the system somewhere on an orbit, shape (rows, n).

    A formula of the rate alone restrains nothing, and neither does one where its force is constant.
    """
    motion = orbit.motion(samples)
    slopes = formula.at(motion.q, motion.v).stiffness
    slopes = slopes[np.isfinite(slopes).all(axis=1)]
    largest = np.abs(slopes).max(initial=0.0)
    if largest == 0.0:
        return np.zeros((0, orbit.system.size))
    # as few rows as there are deflections, with the sizes of the slopes over the orbit
    return np.linalg.qr(slopes / largest, mode="r") @ formula.deflections
