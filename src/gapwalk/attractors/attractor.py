"""The record of an attractor of any kind: a motion on which others settle, with the evidence for its kind."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.lyapunov import Lyapunov
from gapwalk.attractors.rotation import Rotation
from gapwalk.model.system import System, pace_text
from gapwalk.notebook.shown import Shown
from gapwalk.orbit.orbit import Orbit


class AttractorKind(StrEnum):
    """The kind of motion on an attractor."""

    PERIODIC = "periodic"
    QUASI_PERIODIC = "quasi-periodic"
    CHAOTIC = "chaotic"
    UNDECIDED = "undecided"


@dataclass(frozen=True, eq=False)
class Attractor(Shown):
    """A motion on which others settle.

    Attributes
    ----------
    kind
        Kind of motion: periodic, quasi-periodic, chaotic, or undecided.
    system
        The system that moves.
    period
        Period m of a periodic motion; number of closed curves, visited in turn, of a quasi-periodic one; otherwise 0.
    strobes : shape (count, 2n)
        States at theta = 0, one forcing period apart: all m of an orbit, or a sample of another motion.
    orbit
        The orbit of a periodic motion; otherwise None.
    lyapunov
        The Lyapunov exponents; those of an orbit follow from its multipliers.
    rotation
        The rotation number of a quasi-periodic motion.
    evidence
        The evidence for the kind, in sentences.
    """

    kind: AttractorKind
    system: System
    period: int
    strobes: NDArray[np.float64]
    orbit: Orbit | None
    lyapunov: Lyapunov | None
    rotation: Rotation | None
    evidence: tuple[str, ...]

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if self.strobes.ndim != 2 or self.strobes.shape[1] != 2 * self.system.size or not len(self.strobes):
            raise ValueError(f"strobes of shape {self.strobes.shape} are none of this system")

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the motion at theta = 0, shape (2n,)."""
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
