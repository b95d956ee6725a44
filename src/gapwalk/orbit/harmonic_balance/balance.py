"""How to balance harmonics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from gapwalk.errors import ModelError
from gapwalk.model.system import System
from gapwalk.orbit.method import Method
from gapwalk.orbit.orbit import Orbit

if TYPE_CHECKING:
    from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation

_FIRST = 10  # harmonics to begin with, where the number is left open
STABILITIES = ("variational", "hill")


@dataclass(frozen=True, slots=True)
class Balance(Method):
    """Harmonic balance: the motion as a Fourier series, its contact forces exact in the breakpoints.

    Parameters
    ----------
    harmonics
        H, the highest harmonic of the forcing frequency; an orbit of m forcing periods has H m lines. None: as many
        as the stated `error` needs, and more where a branch needs more.
    error
        Largest sum of the amplitudes in the neglected harmonics (those from H to 2 H, as the exact contact force
        drives them), relative to the largest amplitude of the deflections. A motion that exceeds it is refused.
    stability
        ``"variational"``: multipliers of the motion linearised about the balanced one, by one pass over a period.
        ``"hill"``: by the projected exponential of Hill's matrix (Bayer and Leine 2023).
    tolerance
        Largest residual of an orbit, relative to the size of its lines.
    """

    name: ClassVar[str] = "harmonic-balance"
    columns: ClassVar[tuple[str, ...]] = ("harmonics", "truncation")
    needs_contacts: ClassVar[str] = "solves for the deflections of contacts"

    harmonics: int | None = None
    error: float = 1e-4
    stability: str = "variational"
    tolerance: float = 1e-10

    def __post_init__(self) -> None:
        h = self.harmonics
        if h is not None and (isinstance(h, bool) or not isinstance(h, int) or not 1 <= h <= 2000):
            raise ModelError(
                f"harmonics is {h!r}; it must be an integer from 1 to 2000, or None for an automatic choice"
            )
        if not 1e-12 <= self.error <= 1.0:
            raise ModelError(f"error is {self.error!r}; it must lie between 1e-12 and 1 (a share of the amplitude)")
        if self.stability not in STABILITIES:
            raise ModelError(f'stability is {self.stability!r}; write "variational" or "hill"')
        if not 1e-14 <= self.tolerance <= 1e-3:
            raise ModelError(f"tolerance is {self.tolerance!r}; it must lie between 1e-14 and 1e-3")

    def pose(self, system: System, parameter: str | None = None, period: int = 1) -> BalanceEquation:
        """The equation of the orbits of a system, by harmonic balance."""
        from gapwalk.orbit.harmonic_balance.balance_equation import BalanceEquation

        first = max(_FIRST, 2 * max((harmonic.order for harmonic in system.structure.harmonics), default=1))
        return BalanceEquation(system, parameter, period, self, self.harmonics or first)

    @classmethod
    def resolving(cls, orbit: Orbit, count: int) -> Balance:
        """With as many harmonics as the orbit has."""
        return cls(orbit.harmonics)

    @staticmethod
    def words(orbits: Sequence[Orbit]) -> str:
        """Describe the number of harmonics of orbits, and the size of the omitted ones."""
        fewest, most = (choose(orbit.harmonics for orbit in orbits) for choose in (min, max))
        count = f"{most}" if fewest == most else f"{fewest} to {most}"
        return (
            f"by harmonic balance with {count} harmonics; the omitted ones amount to at most "
            f"{max(orbit.truncation for orbit in orbits):.2g} of a motion"
        )
