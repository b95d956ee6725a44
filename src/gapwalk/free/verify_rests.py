"""Verification of equilibria: the balance of static forces and the eigenvalues, by other formulas than the walk's.

A walk follows the accelerations of the flow. Here the forces are those of the static search, with the mass matrix, and
an eigenvalue must make the matrix of small motions singular.
"""

from __future__ import annotations

import numpy as np

from gapwalk.free.rest_record import RestPoint, Rests
from gapwalk.model.static_search import balance_of
from gapwalk.model.system import System
from gapwalk.verification.verification import Check, Ledger, Spot

_ON = 1e-9  # share of a clearance within which a deflection is at a breakpoint, where derivatives are one-sided


def verify_rests(ledger: Ledger, name: str, rests: Rests) -> None:
    """Enter the checks of all equilibria of a branch."""
    if any(form.law.is_dry for form in rests.system.equations.structure.contacts):
        ledger.note("equilibria with dry friction on a moving base are not verified: a static search leaves it out")
        return
    for number, point in enumerate(rests.points):
        system = rests.system.at({rests.parameter: point.value}).equations
        if not _is_at_breakpoint(system, point):
            ledger.enter(Check.REST, Spot(name, f"point {number}", point.value), _fault(system, point))
        ledger.points += 1


def _fault(system: System, point: RestPoint) -> float:
    """Return the larger of the relative imbalance of forces and the relative singular value of an eigenvalue."""
    balance, x = balance_of(system), point.position
    force, sizes, stiffness = balance.unbalanced(x)
    damping = system.matrix("damping").copy()
    for each in balance.forces:
        damping += np.outer(each.direction, each.at(x).damping @ each.deflections)
    worst = float(np.abs(force).max() / max(float(sizes.max()), 1e-300)) if np.abs(x).max() > 0.0 else 0.0
    mass = system.matrix("mass")
    for value in (point.eigenvalues[0], point.eigenvalues[-1]):
        matrix = mass * value**2 + damping * value + stiffness
        size = np.abs(mass * value**2).max() + np.abs(damping * value).max() + np.abs(stiffness).max()
        worst = max(worst, float(np.linalg.svd(matrix, compute_uv=False)[-1] / size))
    return worst


def _is_at_breakpoint(system: System, point: RestPoint) -> bool:
    vectors = [system.vector(form.vectors[0]) for form in system.structure.contacts]
    depths = [side * float(vectors[k] @ point.position) - clearance for k, side, clearance in system.breakpoints]
    unit = float(np.abs(point.position).max())
    return any(abs(depth) <= _ON * unit for depth in depths)
