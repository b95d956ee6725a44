"""Homotopy: a path from some values of parameters to others as one more parameter, continued like any other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.coefficients import layout_of
from gapwalk.model.structure import NameBlock, ParameterNames, Structure
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.model.value_checks import value_problems

WAY = "way"
"""The name of the parameter: 0 at the first values, 1 at the others."""


@dataclass(frozen=True)
class PathAssembly:
    """Parameters that move together, linearly, while the path parameter goes from 0 to 1.

    Its own numbers are those of the system, then the path parameter, then the final value of each parameter. As they
    are numbers, all paths of the same parameters share one compiled flow.
    """

    structure: Structure  #: The structure of the system.
    moved: tuple[str, ...]  #: The names of the parameters without the frequency, by which everything is scaled.

    @property
    def names(self) -> ParameterNames:
        """Names of the system's parameters, of the path parameter, and ``way.`` with each moved parameter."""
        inner = self.structure.names
        blocks = (NameBlock(WAY), *(NameBlock(f"{WAY}.{name}") for name in self.moved))
        return replace(inner, blocks=(*inner.blocks, *blocks))

    @property
    def units(self) -> Units | None:
        """The units of the system's parameters."""
        return self.structure.units

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion."""
        return self.structure.expand(self.inner(values))

    def accelerations(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the accelerations of the system; see `Assembly.accelerations`."""
        return layout_of(self.structure).table(self.inner(values))

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of the values of the system at this point of the path."""
        yield from value_problems(self.structure, self.inner(values))

    def inner(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the system at this point of the path."""
        size, count = len(self.structure.names), len(self.moved)
        found, share, ends = values[:size].copy(), values[size], values[size + 1 : size + 1 + count]
        found[self._places] += share * (ends - found[self._places])
        return found

    @cached_property
    def _places(self) -> list[int]:
        return [self.structure.place(name) for name in self.moved]


def on_the_way(system: System, to: Mapping[str, float]) -> System:
    """Add a parameter ``way`` to a system: at 0 it is the given system, at 1 some parameters have other values."""
    system.at(to)
    structure = system.structure
    if structure.pace in to:
        raise ModelError(
            f"{structure.pace} cannot move together with others: everything is scaled by it; follow it by itself"
        )
    if isinstance(structure.assembly, PathAssembly):
        raise ModelError("the system already has a parameter path; start from the system without one")
    assembly = PathAssembly(structure, tuple(to))
    whole = Structure(structure.coordinates, structure.contacts, structure.harmonics, assembly)
    return System.from_values(whole, np.concatenate((system.values, [0.0], list(to.values()))))
