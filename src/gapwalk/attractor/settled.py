"""Where a motion has settled: the record of a transient and of what it came to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.system import System, pace_text
from gapwalk.motion.motion import Motion, integrate
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
        The last states of the transient at theta = 0, a forcing period apart; positions, then velocities.
    periods
        Forcing periods that the transient was followed for.
    converged
        Whether the motion has settled; if not, `evidence` says what it still does.
    orbit
        The stable orbit to which the motion comes, polished by Newton's method; None where it is not periodic.
    residual
        Distance from the orbit when it was recognised, or drift of the motion's averages between the last two
        windows; relative to the size of the motion.
    evidence
        What the judgement rests on, in sentences.
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
        """m, forcing periods after which it repeats; None where it is not periodic."""
        return self.orbit.period if self.orbit is not None else None

    @property
    def state(self) -> NDArray[np.float64]:
        """A state of the settled motion at theta = 0, shape (2n,): of the orbit if there is one."""
        return self.orbit.state if self.orbit is not None else self.strobes[-1]

    def motion(self, periods: int | None = None, samples: int = 256) -> Motion:
        """The settled motion, sampled; the contact log and the force-deflection loop are in it.

        Parameters
        ----------
        periods
            Forcing periods; by default those of the orbit, or 64.
        samples
            Samples a forcing period.
        """
        return integrate(self.system, self.state, periods or self.period or 64, samples)

    def plot(self, signal: str | None = None, **options: Any):
        """Draw time history, spectrum and section; see `gapwalk.plot.motions.draw_settled`. Returns the figure."""
        from gapwalk.plot import draw

        return draw(self, signal, **options)

    def __repr__(self) -> str:
        what = f"period {self.period}" if self.period else "not periodic"
        done = "settled" if self.converged else "not settled"
        return (
            f"Settled({what}, {done} after {self.periods} forcing periods at {pace_text(self.system)}, "
            f"residual {self.residual:.2g})"
        )
