"""Equations of motion whose numbers follow from others: over the frequency, and of coordinates without inertia.

    M q'' + (C + W G) q' + (K + W^2 H) q + ...

Of a rotor that turns at the speed W, G is the gyroscopic matrix (skew) and H that of centrifugal forces. A force by a
formula may contain W. The numbers of such a system are those of C, K, G and H; the equations of motion have the sums.
Coordinates without inertia are computed from others: see `gapwalk.model.states`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.laws.formula import PACE, STATE_LAG, is_computed
from gapwalk.model.loads.load import FactorOverSpeed
from gapwalk.model.registry import NameBlock, ParameterNames
from gapwalk.model.states import FAST, LAG
from gapwalk.model.structure import Structure
from gapwalk.model.value_checks import value_problems

GROWING = {"gyroscopic": ("damping", 1), "centrifugal": ("stiffness", 2)}
"""The matrices that grow with the frequency: the one to which each is added, and the power of the frequency."""


@dataclass(frozen=True)
class PacedMatrices:
    """Assembly of equations of motion from numbers of a system that are not all theirs."""

    inner: Structure  #: The equations of motion, with the numbers that follow from others.
    matrices: tuple[str, ...] = ()  #: Those of `GROWING` that there are.
    over_speed: tuple[tuple[str, FactorOverSpeed], ...] = ()  #: The other numbers that depend on the frequency.
    massless: tuple[int, ...] = ()  #: The coordinates that carry a state without inertia, by their numbers.
    lag: float = 0.0  #: The lag by which they do, in units of time.
    by_formula: int = 0  #: The number of those, the last ones, whose equations are formulas: see `State`.
    #: Numbers and vectors of the equations that are those of the system of another name: both names.
    copies: tuple[tuple[str, str], ...] = ()
    units: ClassVar[None] = None
    """Such a system has plain numbers."""

    def _check_read(self) -> None:
        """Raise a ValueError if its parts are inconsistent."""
        prefixes = {block.prefix for block in self.inner.names.blocks}
        if not all(0 <= place < self.inner.size for place in self.massless) or not self.lag >= 0.0:
            raise ValueError("the system has no such coordinate without inertia")
        if not {name for name, _ in self.copies} <= prefixes:
            raise ValueError("a copied number or vector does not exist in the system")

    @property
    def states(self) -> tuple[str, ...]:
        """The names of the states without inertia."""
        return tuple(self.names.coordinates[place] for place in self.massless)

    @cached_property
    def names(self) -> ParameterNames:
        """See `Assembly.names`: those matrices follow the stiffness."""
        blocks: dict[str, NameBlock] = {}
        for own, block in self._known:
            blocks.setdefault(own, NameBlock(own, block.rank))
            if block.prefix == "stiffness":
                blocks |= {name: NameBlock(name, 2) for name in self.matrices}
        names = [
            name.removesuffix(LAG) if place in self.massless else name
            for place, name in enumerate(self.inner.coordinates)
        ]
        return ParameterNames(tuple(blocks.values()), tuple(names))

    @cached_property
    def _known(self) -> list[tuple[str, NameBlock]]:
        """The blocks of the equations that are numbers of the system, each with its name there."""
        own = dict(self.copies)
        blocks = [block for block in self.inner.names.blocks if not is_computed(block.prefix)]
        return [(own.get(block.prefix, block.prefix), block) for block in blocks]

    @cached_property
    def is_paced(self) -> bool:
        """See `Assembly.is_paced`."""
        names = (name for form in self.inner.contacts for name in form.parameters)
        return bool(self.matrices or self.over_speed or any(name.endswith(f".{PACE}") for name in names))

    @cached_property
    def _places(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The places in the equations of the numbers of the system, and those among its own."""
        n = self.inner.size
        inner = [self.inner.names.start(block.prefix) + np.arange(n**block.rank) for _, block in self._known]
        own = [self.names.start(name) + np.arange(n**block.rank) for name, block in self._known]
        return np.concatenate(inner), np.concatenate(own)

    @cached_property
    def _lags(self) -> NDArray[np.intp]:
        """The places in the equations of the lag."""
        names = [name for form in self.inner.contacts for name in form.parameters if name.endswith(f".{STATE_LAG}")]
        return np.array([self.inner.place(name) for name in names], dtype=np.intp)

    @cached_property
    def _others(self) -> NDArray[np.intp]:
        """The places in the equations of the entries that parts of deflections without inertia do not have."""
        n = self.inner.size
        rest = [place for place in range(n) if place not in self.massless]
        found = [self.inner.block(name, n)[rest] for name, _ in self.copies if name.endswith(FAST)]
        return np.concatenate(found) if found else np.zeros(0, dtype=np.intp)

    def expand(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of the equations of motion; see `Assembly.expand`."""
        if self.over_speed:
            values = values.copy()
            for name, factor in self.over_speed:
                values[self.names.place(name)] *= factor.value(values[0])
        inner, own = self._places
        found = np.full(len(self.inner.names), values[0], dtype=values.dtype)  # what is left is W, or the lag
        found[inner] = values[own]
        found[self._lags], found[self._others] = self.lag, 0.0
        n = self.inner.size
        for name in self.matrices:
            base, power = GROWING[name]
            found[self.inner.block(base, n, n)] += values[0] ** power * self._own(values, name)
        own_rates = list(range(n - self.by_formula, n))
        found[self.inner.block("stiffness", n, n)[own_rates, own_rates]] += 1.0 / self.lag if own_rates else 0.0
        if self.massless:
            mass, damping, stiffness = (self.inner.block(name, n, n) for name in ("mass", "damping", "stiffness"))
            found[mass] += found[damping] @ self.lagging(values)
            found[damping] += found[stiffness] @ self.lagging(values)
        return found

    def lagging(self, values: NDArray[Any]) -> NDArray[np.float64] | None:
        """Return the matrix of the lag by which states without inertia are carried, shape (n, n); None if none are."""
        own = np.isin(range(self.inner.size), self.massless)
        return np.diag(np.where(own, self.lag, 0.0)) if self.massless else None

    def _own(self, values: NDArray[Any], name: str) -> NDArray[Any]:
        """Return a matrix of the system."""
        n, first = self.inner.size, self.names.start(name)
        return values[first : first + n * n].reshape(n, n)

    def accelerations(self, values: NDArray[Any]) -> None:
        """Return None: see `Assembly.accelerations`."""

    def problems(self, values: NDArray[np.float64]) -> Iterator[str]:
        """List the errors of the equations of motion at this frequency, one sentence each."""
        found = [*self._problems_of_states(values)] if self.massless else []
        yield from found or value_problems(self.inner, self.expand(values))

    def _problems_of_states(self, values: NDArray[np.float64]) -> Iterator[str]:
        mass, damping, slow = self._own(values, "mass"), self._own(values, "damping"), list(self.massless)
        names, coordinates = ", ".join(self.states), np.array(self.names.coordinates)
        if heavy := [place for place in slow if mass[place].any() or mass[:, place].any()]:
            yield (
                f"mass gives {coordinates[heavy[0]]} an inertia, but the system was made without one; make it again "
                "with that mass"
            )
            return
        own = damping[np.ix_(slow, slow)]
        sizes = np.sqrt(np.maximum(np.abs(own).max(axis=1, initial=0.0), 1e-300))
        scaled = own / np.outer(sizes, sizes)
        if not np.linalg.svd(scaled, compute_uv=False)[-1] > _SINGULAR:
            idle = [str(coordinates[place]) for place, row in zip(slow, own, strict=True) if not row.any()]
            shown = " and ".join(idle[:_SHOWN] + [f"{len(idle) - _SHOWN} others"] * (len(idle) > _SHOWN)) or names
            yield (
                f"{shown} {'have' if len(idle) > 1 else 'has'} neither inertia nor damping, so that no equation gives "
                "the rate; write one of the two, or leave the coordinate out: two springs in "
                "series are one spring with the stiffness k1*k2/(k1 + k2)"
            )
        elif np.linalg.eigvalsh(0.5 * (scaled + scaled.T))[0] < -_SINGULAR:
            yield (
                f"the damping of {names}, which has no inertia, is negative, so that it diverges by itself; look at "
                "the signs of the damping"
            )


_SHOWN = 3  # names that are listed of more
_SINGULAR = 1e-12  # share of the damping of coordinates without inertia below which they have none
