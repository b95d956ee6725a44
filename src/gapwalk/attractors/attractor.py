"""Records of settled motions: an attractor of any kind with the evidence for it, and the transient that led to it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.lyapunov import Lyapunov
from gapwalk.attractors.rotation import Rotation
from gapwalk.flow.motion import Motion, integrate
from gapwalk.model.system import System, pace_text
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True, eq=False)
class Attractor(Shown):
    """A motion on which others settle.

    Examples
    --------
    >>> attractor.label, attractor.multipliers.shape
    ('P1', (2,))
    """

    kind: AttractorKind  #: Kind of motion: periodic, quasi-periodic, chaotic, or undecided.
    system: System  #: The system that moves.
    #: Period m of a periodic motion; number of closed curves, visited in turn, of a quasi-periodic one; otherwise 0.
    period: int
    #: shape (count, state_size): States at theta = 0, one forcing period apart: all m of an orbit, or a sample of
    #: another motion.
    strobes: NDArray[np.float64]
    orbit: Orbit | None  #: The orbit of a periodic motion; otherwise None.
    lyapunov: Lyapunov | None  #: The Lyapunov exponents; those of an orbit follow from its multipliers.
    rotation: Rotation | None  #: The rotation number of a quasi-periodic motion.
    evidence: tuple[str, ...]  #: The evidence for the kind, in sentences.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.strobes.ndim != 2 or self.strobes.shape[1] != self.system.state_size or not len(self.strobes):
            raise ValueError(f"strobes of shape {self.strobes.shape} do not belong to this system")

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the motion at theta = 0, shape (state_size,)."""
        return self.strobes[0]

    @property
    def multipliers(self) -> NDArray[np.complex128] | None:
        """Floquet multipliers of an orbit, largest modulus first; None for any other motion."""
        return None if self.orbit is None else self.orbit.multipliers

    @property
    def label(self) -> str:
        """A short name: ``P3``, ``torus`` (``3 x torus`` if it surrounds an orbit of period 3), ``chaos`` or ``?``."""
        match self.kind:
            case AttractorKind.PERIODIC:
                return f"P{self.period}"
            case AttractorKind.QUASI_PERIODIC:
                return "torus" if self.period <= 1 else f"{self.period} x torus"
            case AttractorKind.CHAOTIC:
                return "chaos"
            case AttractorKind.UNDECIDED:
                return "?"

    def __repr__(self) -> str:
        details = [self.label, pace_text(self.system)]
        if self.rotation is not None:
            details.append(f"rotation number {self.rotation.number:.9g}")
        if self.lyapunov is not None:
            details.append(f"largest exponent {self.lyapunov.exponents[0]:.4g} +- {self.lyapunov.errors[0]:.1g}")
        return f"Attractor({self.kind.value}: {', '.join(details)})"


class AttractorKind(StrEnum):
    """The kind of motion on an attractor.

    Examples
    --------
    >>> attractor.kind is gw.records.AttractorKind.PERIODIC
    True
    """

    PERIODIC = "periodic"
    QUASI_PERIODIC = "quasi-periodic"
    CHAOTIC = "chaotic"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False)
class Settled(Shown):
    """A motion after its transient.

    Examples
    --------
    >>> settled.converged, settled.period, settled.orbit.stable
    (True, 1, True)
    """

    system: System  #: The system that moves.
    #: shape (count, state_size): The last states of the transient at theta = 0, one forcing period apart; positions,
    #: then velocities.
    strobes: NDArray[np.float64]
    periods: int  #: Length of the transient in forcing periods.
    converged: bool  #: True if the motion has settled; if not, `evidence` gives the reason.
    #: The stable orbit to which the motion converges, refined by Newton's method; None if the motion is not periodic.
    orbit: Orbit | None
    #: Distance from the orbit when it was recognised, or drift of the motion's averages between the last two windows;
    #: relative to the size of the motion.
    residual: float
    evidence: tuple[str, ...]  #: The evidence for the decision, in sentences.

    def _check_read(self) -> None:
        """Raise a ValueError if its parts do not fit together."""
        if self.strobes.ndim != 2 or self.strobes.shape[1] != self.system.state_size or not len(self.strobes):
            raise ValueError(f"strobes of shape {self.strobes.shape} do not belong to this system")

    @property
    def period(self) -> int | None:
        """Period m in forcing periods; None if the motion is not periodic."""
        return self.orbit.period if self.orbit is not None else None

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the settled motion at theta = 0, shape (state_size,); a state of the orbit if there is one."""
        return self.orbit.state if self.orbit is not None else self.strobes[-1]

    def motion(self, periods: int | None = None, samples: int = 256) -> Motion:
        """Return the settled motion, sampled, with its contact events and force-deflection loops.

        Parameters
        ----------
        periods
            Forcing periods; by default those of the orbit, or 64.
        samples
            Samples per forcing period.
        """
        return integrate(self.system, self.state, periods or self.period or 64, samples)

    def __repr__(self) -> str:
        what = f"period {self.period}" if self.period else "not periodic"
        done = "settled" if self.converged else "not settled"
        return (
            f"Settled({what}, {done} after {self.periods} forcing periods at {pace_text(self.system)}, "
            f"residual {self.residual:.2g})"
        )
