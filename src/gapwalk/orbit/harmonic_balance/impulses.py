"""Gates that open and close: impulses where a damping jumps over the angle, and the effect of angles that move.

While a gate G is open, a row of polynomials adds the force ``G g + G dP/dt = G g + d/dt (G P) - G' P``. The derivative
G' is an impulse at each angle at which the gate opens or closes. Its lines are known in closed form. The impulse
cancels with that of ``d/dt (G P)``, but the momenta ``p = v + D P`` of the variational equations jump.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.orbit.harmonic_balance.series import waves

if TYPE_CHECKING:
    from gapwalk.orbit.harmonic_balance.contact_forces import Laws
    from gapwalk.orbit.harmonic_balance.linear_part import Linear

Array = NDArray[np.float64]


class Passage(NamedTuple):
    """A row of polynomials at the angles at which its gate opens (sign 1) or closes (-1)."""

    row: int  #: Its number.
    #: phi, signs, moves: shape (angles,): The angles, and their derivatives by the parameter.
    phi: Array
    signs: Array
    moves: Array
    #: forces, by_deflection, by_angle, slopes: shape (2, angles): g and P there, and their derivatives by the
    #: deflection, by phi along the motion, and by the parameter.
    forces: Array
    by_deflection: Array
    by_angle: Array
    slopes: Array


def passages(lines: NDArray[np.complex128], laws: Laws, period: int) -> list[Passage]:
    """Return all rows that have a gate, at the angles at which it opens or closes."""
    (angles, opens, gates), moves = laws.jumps.over(period), np.tile(laws.jumps.slopes, period) / period
    orders, count = laws.orders.astype(float) * period, lines.shape[1] - 1
    found: list[Passage] = []
    for row in np.flatnonzero(laws.gate >= 0):
        here = gates == laws.gate[row]
        phi, turns = angles[here], waves(angles[here], count)
        own = lines[laws.contact[row]]
        depth = laws.sign[row] * (turns @ own).real - laws.clearance[row]
        speed = (turns @ (1j * np.arange(count + 1) * own)).real
        cosines, sines = np.cos(np.multiply.outer(phi, orders)), np.sin(np.multiply.outer(phi, orders))
        wave = np.concatenate((cosines, sines), axis=1)
        turned = np.concatenate((-sines * orders, cosines * orders), axis=1)
        powers = depth[:, None] ** np.arange(laws.polynomials.shape[2]) * (depth > 0.0)[:, None]

        def values(steady: Array | float, varied: Array, wave: Array, powers: Array = powers) -> Array:
            """Evaluate polynomials with coefficients that vary, shape (2, angles)."""
            return ((steady + np.moveaxis(varied @ wave.T, -1, 0)) * powers[:, None]).sum(axis=2).T

        by_deflection = values(laws.rates[row], laws.wave_rates[row], wave)
        by_angle = by_deflection * speed + values(0.0, laws.waves[row], turned)
        forces = values(laws.polynomials[row], laws.waves[row], wave)
        slopes = values(laws.slope_table[row], laws.wave_slope_table[row], wave)
        signs = np.where(opens[here] > 0.0, 1.0, -1.0)
        found.append(Passage(int(row), phi, signs, moves[here], forces, by_deflection, by_angle, slopes))
    return found


def add_passages(
    lines: NDArray[np.complex128],
    laws: Laws,
    period: int,
    parts: NDArray[np.complex128],
    slopes: NDArray[np.complex128],
) -> None:
    """Add impulses, and what moves with the angles, to the lines of forces and their slopes (see `Forces`)."""
    count, (frequency, faster) = lines.shape[1] - 1, (each / period for each in laws.frequency)
    k = np.arange(2 * count + 1)
    doubled = np.where(k, 2.0, 1.0)
    for each in passages(lines, laws, period):
        contact, turns = laws.contact[each.row], waves(-each.phi, 2 * count) / (2.0 * np.pi)
        signed, impulses = each.signs * turns.T, -frequency * each.signs * turns.T
        parts[contact, 0] += doubled * (impulses @ each.forces[1])
        parts[contact, 1] += impulses @ each.by_deflection[1]
        change = impulses @ (each.slopes[1] + each.by_angle[1] * each.moves)
        change += (-1j * k) * (impulses @ (each.forces[1] * each.moves))
        change -= faster * (signed @ each.forces[1])
        change -= signed @ (each.forces[0] * each.moves)
        slopes[contact, 0] += (doubled * change)[: count + 1]
        slopes[contact, 1] -= (doubled * (signed @ (each.forces[1] * each.moves)))[: count + 1]


def kicks(lines: NDArray[np.complex128], laws: Laws, period: int, linear: Linear) -> tuple[Array, Array]:
    """Return the angles at which momenta jump with positions, as gates open and close, and how, as matrices."""
    n, angles, changes = len(linear.stiffness), [], []
    for each in passages(lines, laws, period):
        place = laws.contact[each.row]
        along: Array = linear.contacts[:, place, None] * linear.deflections[place]
        for phi, size in zip(each.phi, each.signs * each.by_deflection[1], strict=True):
            if size:
                angles.append(phi)
                changes.append(np.zeros((2 * n, 2 * n)))
                changes[-1][n:, :n] = size * along
    return np.array(angles, dtype=float), np.array(changes).reshape(len(angles), 2 * n, 2 * n)
