"""Options of harmonic balance, and the orbits that it finds: their motion is evaluated from their Fourier series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.motion import Motion
from gapwalk.model.bounds import check_fields
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.system import System
from gapwalk.orbit.harmonic_balance.linear_part import Series, deflections_in, firsts_of
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit, Turns

if TYPE_CHECKING:
    from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation
    from gapwalk.orbit.harmonic_balance.jenkins_forces import Memory


_FIRST = 10  # initial number of harmonics, if it is chosen automatically
_MANY = 800  # unknowns from which shooting takes a 25th of the time (measured: 20 gaps with 20 harmonics)
STABILITIES = ("variational", "hill")


@dataclass(frozen=True, slots=True)
class Balance(Method):
    """Harmonic balance: orbits as Fourier series, with exact contact forces.

    Examples
    --------
    >>> round(gw.find_orbit(system, method=gw.Balance(5)).measure("max.x"), 6)  # the stop is not touched
    0.777839
    """

    name: ClassVar[str] = "harmonic-balance"
    columns: ClassVar[tuple[str, ...]] = ("harmonics", "truncation")
    needs_contacts: ClassVar[str] = "solves for the deflections of contacts"

    #: H, the highest harmonic of the forcing frequency; an orbit of m forcing periods has H m harmonics of its own.
    #: None: as many as `error` requires, and more where a branch requires more.
    harmonics: Annotated[int, Ge(1), Le(2000)] | None = None
    #: Largest sum of the amplitudes in the neglected harmonics (from H to 2 H, as excited by the exact contact force),
    #: relative to the largest amplitude of the deflections. A motion that exceeds it is refused.
    error: Annotated[float, Ge(1e-12), Le(1)] = 1e-4
    #: ``"variational"``: multipliers of the motion linearised about the balanced one, by one pass over the period.
    #: ``"hill"``: by the projected exponential of Hill's matrix (Bayer and Leine 2023).
    stability: str = "variational"
    #: Largest residual of an orbit, relative to its Fourier coefficients.
    tolerance: Annotated[float, Ge(1e-14), Le(1e-3)] = 1e-10
    #: True to use harmonic balance also for systems with about 20 gaps or more; otherwise studies use shooting there,
    #: which is 25 times faster.
    only: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        if self.stability not in STABILITIES:
            raise ModelError(f'stability is "{self.stability}"; it must be one of "variational", "hill"')

    def pose(self, system: System, parameter: str | None = None, period: int = 1) -> BalanceEquation:
        """Pose the orbits of a system as a harmonic balance equation."""
        from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation

        orders = (order for load in system.structure.harmonics for order in load.orders)
        first = max(_FIRST, 2 * max(orders, default=1))
        return BalanceEquation(system, parameter, period, self, self.harmonics or first)

    def suited_to(self, system: System) -> Method:
        """Return this method, or `Shooting` where so many unknowns would make this one far slower."""
        unknowns = deflections_in(system.structure) * (2 * (self.harmonics or _FIRST) + 1)
        return self if self.only or unknowns < _MANY else Method.known()[0]()

    @classmethod
    def resolving(cls, orbit: Orbit, count: int) -> Balance:
        """Return the method with as many harmonics as the orbit has."""
        return cls(orbit.harmonics)

    @staticmethod
    def words(orbits: Sequence[Orbit]) -> str:
        """Describe the number of harmonics of orbits, and the size of the omitted ones."""
        if any(orbit.is_exact for orbit in orbits):
            return (
                "by shooting, in place of harmonic balance, which takes some 25 times as long for so many unknowns; "
                "to use it nevertheless, write only = true in [study.balance], or Balance(only=True)"
            )
        fewest, most = (choose(orbit.harmonics for orbit in orbits) for choose in (min, max))
        count = f"{most}" if fewest == most else f"{fewest} to {most}"
        return (
            f"by harmonic balance with {count} harmonics; the omitted ones amount to at most "
            f"{max(orbit.truncation for orbit in orbits):.2g} of a motion"
        )


_AMPLIFIED = 30.0  # largest error of multipliers, in multiples of the truncation


@dataclass(frozen=True, eq=False, repr=False)
class BalancedOrbit(Orbit):
    """An orbit given by its Fourier series.

    It satisfies the equations of motion except for the neglected harmonics. An integration from its state would
    leave an unstable orbit, so everything is evaluated from the series.
    """

    found_by: ClassVar[str] = "harmonic-balance"
    is_exact: ClassVar[bool] = False

    series: Series  #: The lines of all coordinates.
    #: The lines of the deflections of all contacts: of a force by a formula, of all that it depends on.
    deflections: Series
    #: Sum of the amplitudes of the neglected harmonics, as excited by the exact contact force, relative to the largest
    #: amplitude of the deflections.
    truncation: float = field()

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        super()._check_read()
        series = (self.series, self.deflections)
        rows, widths = zip(*(each.lines.shape for each in series), strict=True)
        if rows != (self.system.size, deflections_in(self.system.structure)) or not 0 < min(widths) == max(widths):
            raise ValueError("the Fourier series of an orbit do not fit its coordinates and contacts")
        if any(each.period != self.period for each in series):
            raise ValueError("the Fourier series of an orbit have another period than the orbit")

    @property
    def harmonics(self) -> int:
        """H, the highest harmonic of the forcing frequency."""
        return (self.series.lines.shape[1] - 1) // self.period

    @cached_property
    def multiplier_error(self) -> float:
        """Approximate error of the multipliers due to truncation: thirty times the truncation."""
        return _AMPLIFIED * self.truncation

    def motion(self, samples: int | None = None) -> Motion:
        """Sample one full period evenly, with `samples` per forcing period."""
        count = (samples or self.samples) * self.period
        theta = PERIOD * self.period * np.arange(count + 1) / count
        return Motion.of(self.system, theta, self._states(theta), self.events, self.slips)

    def strobes(self, count: int, apart: float = PERIOD) -> NDArray[np.float64]:
        """Return the first `count` states at intervals of `apart` radians of theta, shape (count, state_size)."""
        return self._states(apart * np.arange(count, dtype=float))

    def _states(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states at some angles, shape (samples, state_size)."""
        states = self.series.states(theta)
        return np.hstack((states, self._memory.extensions(theta / self.period))) if self._memory else states

    @cached_property
    def _memory(self) -> Memory | None:
        """The Jenkins elements along the motion; None if there are none."""
        if not self.system.structure.memories:
            return None
        from gapwalk.orbit.harmonic_balance.contact_forces import contact_forces_of, laws_of  # numba loads slowly

        laws = laws_of(layout_of(self.system.structure), coefficients_of(self.system))
        return contact_forces_of(self.deflections.lines, laws, self.period).memory

    @cached_property
    def turns(self) -> tuple[Turns, ...]:
        """For each contact the angles at which its first deflection turns, and its values there."""
        turns = self.deflections.turns()
        found = [turns[first] for first in firsts_of(self.system.structure)]
        return tuple(Turns(*each[:, np.argsort(each[0])].tolist()) for each in found)

    @cached_property
    def extremes(self) -> NDArray[np.float64]:
        """Maximum, minimum, mean and root mean square of each coordinate, shape (n, 4)."""
        return self.series.extremes()
