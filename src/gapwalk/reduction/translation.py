"""Translation between a full system and its reduced one: corresponding parameters, and conversion of systems."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.reduction.basis import Basis
from gapwalk.reduction.sparse_matrices import Matrices

_MODES = "mode"
_ROUNDING = 1e-13  # relative change of a parameter below which it is only rounding
MATRICES = ("mass", "damping", "stiffness")


def structure_of(full: Structure, basis: Basis) -> Structure:
    """Return the structure of the reduced system: the retained coordinates by name, then mode1, mode2, ..."""
    kept = tuple(full.coordinates[place] for place in basis.kept)
    taken = {*kept, *(contact.name for contact in full.contacts), *(harmonic.name for harmonic in full.harmonics)}
    prefix, count = _MODES, basis.size - len(kept)
    while any(f"{prefix}{number}" in taken for number in range(1, count + 1)):
        prefix += "_"
    names = (*kept, *(f"{prefix}{number}" for number in range(1, count + 1)))
    return Structure(names, full.contacts, full.harmonics)


def reduced_system(full: System, basis: Basis, small: Matrices) -> System:
    """Build the reduced system with all values of the full one.

    Parameters
    ----------
    full
        The full system.
    basis
        The basis.
    small
        The matrices of the full system in the basis.
    """
    structure = structure_of(full.structure, basis)
    n, r = full.size, basis.size
    count = 1 + 3 * r * r + r + sum(2 + r for _ in structure.harmonics)
    count += sum(
        r * (2 - form.reciprocal) + 3 * len(form.stages) + bool(form.damping_name) for form in full.structure.contacts
    )
    values = np.zeros(count)
    for which in MATRICES:
        values[structure.block(which, r, r)] = getattr(small, which).toarray()
    for prefix in vectors_of(structure):
        values[structure.block(prefix, r)] = full.values[full.structure.block(prefix, n)] @ basis.vectors
    for name in scalars_of(structure):
        values[structure.place(name)] = full[name]
    return System.from_values(structure, values).at()  # `at` checks what `from_values` does not


def vectors_of(structure: Structure) -> list[str]:
    """Return the prefixes of the names of parameters that belong to one coordinate each."""
    found = ["mean", *(f"{harmonic.name}.acts_on" for harmonic in structure.harmonics)]
    for contact in structure.contacts:
        found += [f"{contact.name}.deflection"] + [f"{contact.name}.force"] * (not contact.reciprocal)
    return found


def scalars_of(structure: Structure) -> list[str]:
    """Return the names of the parameters that belong to no coordinate: they are the same in both systems."""
    found = ["frequency"]
    for harmonic in structure.harmonics:
        found += [f"{harmonic.name}.amplitude", f"{harmonic.name}.phase"]
    for contact in structure.contacts:
        for stage in contact.stages:
            found += [f"{contact.stage_prefix(stage)}.{what}" for what in ("clearance", "stiffness", "cubic")]
        found += [f"{contact.name}.{contact.damping_name}"] * bool(contact.damping_name)
    return found


@dataclass(frozen=True, eq=False)
class Translation:
    """Converts parameter values of the reduced system to the full one.

    Parameters
    ----------
    full, reduced
        The two systems at the time of the reduction.
    kept : shape (kept,)
        Indices of the retained coordinates in the full system.
    """

    full: System
    reduced: System
    kept: NDArray[np.intp]

    def full_at(self, reduced: System) -> System:
        """Return the full system with the values of a reduced one.

        Raises
        ------
        ModelError
            If that is not the reduced system at other values, or a changed parameter has no meaning in the full one.
        """
        if reduced.structure != self.reduced.structure:
            raise ModelError("the system is not the reduced one at other values; take `reduction.system.at(...)`")
        values = self.full.values.copy()
        own, theirs = self._scalars
        values[theirs] = reduced.values[own]
        change = reduced.values - self.reduced.values
        change[np.abs(change) <= _ROUNDING * np.abs(self.reduced.values)] = 0.0
        change[own] = 0.0
        own, theirs = self._kept
        values[theirs] += change[own]
        change[own] = 0.0
        if change.any():
            name = reduced.structure.names[int(np.flatnonzero(change)[0])]
            raise ModelError(
                f"{name} was changed, but belongs to a mode: the full system has no such parameter; change the full "
                "system and reduce it again"
            )
        return System.from_values(self.full.structure, values)

    @cached_property
    def _scalars(self) -> tuple[list[int], list[int]]:
        """Indices of the parameters that belong to no coordinate, in the reduced and in the full system."""
        names = scalars_of(self.reduced.structure)
        return [self.reduced.structure.place(name) for name in names], [
            self.full.structure.place(name) for name in names
        ]

    @cached_property
    def _kept(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the parameters of retained coordinates alone, in both systems; a change is the same in both."""
        sides = []
        for structure, at in ((self.reduced.structure, np.arange(len(self.kept))), (self.full.structure, self.kept)):
            n = structure.size
            squares = [structure.block(which, n, n)[np.ix_(at, at)].ravel() for which in MATRICES]
            sides.append(np.concatenate(squares + [structure.block(prefix, n)[at] for prefix in vectors_of(structure)]))
        return sides[0], sides[1]
