"""The record of a transient and of the settled motion to which it leads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.motion import Motion, integrate
from gapwalk.model.system import System, pace_text
from gapwalk.notebook.shown import Shown
from gapwalk.orbit.orbit import Orbit


@dataclass(frozen=True, eq=False)
class Settled(Shown):
    """A motion after its transient.

    Attributes
    ----------
    system
        The system that moves.
    strobes : shape (count, 2n)
        The last states of the transient at theta = 0, one forcing period apart; positions, then velocities.
    periods
        Length of the transient in forcing periods.
    converged
        True if the motion has settled; if not, `evidence` gives the reason.
    orbit
        The stable orbit to which the motion converges, refined by Newton's method; None if the motion is not periodic.
    residual
        Distance from the orbit when it was recognised, or drift of the motion's averages between the last two
        windows; relative to the size of the motion.
    evidence
        The evidence for the decision, in sentences.
    """

    system: System
    strobes: NDArray[np.float64]
    periods: int
    converged: bool
    orbit: Orbit | None
    residual: float
    evidence: tuple[str, ...]

    def _check_read(self) -> None:
        """A ValueError if its parts do not fit together."""
        if self.strobes.ndim != 2 or self.strobes.shape[1] != 2 * self.system.size or not len(self.strobes):
            raise ValueError(f"strobes of shape {self.strobes.shape} are none of this system")

    @property
    def period(self) -> int | None:
        """Period m in forcing periods; None if the motion is not periodic."""
        return self.orbit.period if self.orbit is not None else None

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the settled motion at theta = 0, shape (2n,); a state of the orbit if there is one."""
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

    def plot(self, signal: str | None = None, **options: Any):
        """Draw time history, spectrum and section; see `gapwalk.plot.motions.draw_settled`. Return the figure."""
        from gapwalk.plot import draw

        return draw(self, signal, **options)

    def __repr__(self) -> str:
        what = f"period {self.period}" if self.period else "not periodic"
        done = "settled" if self.converged else "not settled"
        return (
            f"Settled({what}, {done} after {self.periods} forcing periods at {pace_text(self.system)}, "
            f"residual {self.residual:.2g})"
        )
