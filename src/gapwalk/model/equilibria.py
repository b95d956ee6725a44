"""Where a system rests under its mean load alone: its equilibria, and which clearances are open there.

Method: docs/numerics/equilibria.md
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.spring import Spring, springs_of
from gapwalk.model.statics import by_turns, curves_upwards, has_least_energy, least_energy, tangent, within
from gapwalk.model.system import System

_MANY = 5_000  # combinations of stages that are tried one by one
_TINY = 1e-9  # share of a deflection that counts as none


@dataclass(frozen=True)
class ContactRest:
    """A contact at rest.

    Parameters
    ----------
    name
        Of the contact.
    deflection, force
        Its deflection, and the force of its spring.
    side
        The side on which it touches: +1, -1, or 0 if it is open.
    closed
        The stages that are closed, from the inside out; the only stage of a contact may have no name.
    """

    name: str
    deflection: float
    force: float
    side: int
    closed: tuple[str, ...]

    @property
    def is_open(self) -> bool:
        """Whether none of its stages is closed."""
        return not self.side

    def __str__(self) -> str:
        if self.is_open:
            return f"{self.name} open"
        return f"{self.name} closed{'+' if self.side > 0 else '-'}{f' ({self.closed[-1]})' if self.closed[-1] else ''}"


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A position in which a system rests.

    Parameters
    ----------
    position : shape (n,)
        The coordinates.
    contacts
        Each contact there.
    stiffness, damping : shape (n, n)
        The matrices for small motions about it.
    loose
        In how many ways the system may move from there without any force: it lies free in its gaps. The position is
        then one of many.
    stable
        Whether small motions stay small.
    """

    position: NDArray[np.float64]
    contacts: tuple[ContactRest, ...]
    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    loose: int
    stable: bool

    def __str__(self) -> str:
        texts = [str(contact) for contact in self.contacts] or ["there are no contacts"]
        texts += [f"lies free in {self.loose} way{'s' if self.loose > 1 else ''}"] * bool(self.loose)
        return ", ".join([*texts, *["unstable"] * (not self.stable)])


@dataclass(frozen=True)
class Rest:
    """Where a system rests.

    Parameters
    ----------
    equilibria
        The stable ones first. Empty if there is none: the mean load drives the system away.
    complete
        Whether these are known to be all of them.
    """

    equilibria: tuple[Equilibrium, ...]
    complete: bool

    def __bool__(self) -> bool:
        return bool(self.equilibria)


def rest_of(system: System) -> Rest:
    """Find where a system rests under its mean load, without its excitation.

    Where no spring ever softens and forces follow from an energy, the equilibrium is that of least energy, found by
    Newton's method. Otherwise there may be several: each combination of closed stages is tried; of too many, those to
    which one leads after another. With cubic terms that soften, further ones may lie within one combination.

    Raises
    ------
    ConvergenceError
        If the least energy is not found.
    """
    stiffness, load, springs = system.matrix("stiffness"), system.vector("mean"), springs_of(system)
    if has_least_energy(stiffness, springs):
        position = least_energy(system, stiffness, load, springs)
        found = [] if position is None else [_equilibrium(system, position, springs)]
        return Rest(tuple(found), complete=True)
    ranges = [tuple(spring.ranges()) for spring in springs]
    few = math.prod(map(len, ranges)) <= _MANY
    complete = few and not any(slope.cubic for spring in springs for slope in spring.slopes)
    tried = product(*ranges) if few else by_turns(stiffness, load, springs, ranges)
    positions = [x for each in tried if (x := within(stiffness, load, springs, each)) is not None]
    unit = max((np.abs(x).max() for x in positions), default=0.0) or 1.0
    different = {tuple(np.round(x / unit, 9)): x for x in positions}
    found = [_equilibrium(system, position, springs) for position in different.values()]
    return Rest(tuple(sorted(found, key=lambda each: not each.stable)), complete)


def _equilibrium(system: System, x: NDArray[np.float64], springs: Sequence[Spring]) -> Equilibrium:
    contacts, closed = [], []
    for spring in springs:
        depth = float(spring.deflection @ x)
        margin = _TINY * max(abs(depth), *(each.clearance for each in spring.slopes))
        slopes = spring.closed(depth, margin)
        closed.append(slopes)
        names, side = tuple(each.stage for each in slopes), slopes[0].sign if slopes else 0
        contacts.append(ContactRest(spring.form.name, depth, spring.pull(depth, slopes)[0], side, names))
    stiffness, damping = tangent(system, closed, x)
    if np.array_equal(stiffness, stiffness.T):
        sizes = np.sort(np.abs(np.linalg.eigvalsh(stiffness)))[::-1]
    else:
        sizes = np.linalg.svd(stiffness, compute_uv=False)
    stiffest = np.abs(tangent(system, [spring.innermost() for spring in springs])[0]).max()
    loose = int(np.sum(sizes <= 1e-10 * max(sizes[0], stiffest)))
    return Equilibrium(x, tuple(contacts), stiffness, damping, loose, _is_stable(system, stiffness, damping))


def _is_stable(system: System, stiffness: NDArray[np.float64], damping: NDArray[np.float64]) -> bool:
    if curves_upwards(stiffness) and curves_upwards(damping):
        return True  # as Kelvin and Tait have it; of a large system the eigenvalues below would take long
    n = system.size
    rates = np.linalg.solve(system.matrix("mass"), np.hstack((stiffness, damping)))
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-rates[:, :n], -rates[:, n:]]])
    values = np.linalg.eigvals(matrix)
    return bool(values.real.max() <= 1e-7 * np.abs(values).max())
