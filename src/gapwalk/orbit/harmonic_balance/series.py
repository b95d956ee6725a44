"""A periodic motion as a finite Fourier series: its values, its turning points, and its means, all in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.flow import PERIOD
from gapwalk.orbit.harmonic_balance.fourier_lines import differentiated, grid, waves


@dataclass(frozen=True, eq=False)
class Series:
    """``q(theta) = Re sum_k lines_k exp(i k theta / m)``.

    Attributes
    ----------
    lines : shape (n, K + 1)
        Complex amplitudes of each coordinate.
    period
        m, forcing periods.
    frequency
        W.
    """

    lines: NDArray[np.complex128]
    period: int
    frequency: float

    def states(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions and velocities (over time) at angles of the excitation, shape (samples, 2n)."""
        wave = waves(np.asarray(theta) / self.period, self.lines.shape[1] - 1)
        rates = (self.frequency / self.period) * differentiated(self.lines)
        return np.hstack(((wave @ self.lines.T).real, (wave @ rates.T).real))

    def start(self) -> NDArray[np.float64]:
        """The state at theta = 0, shape (2n,)."""
        state = (self.lines @ _first_values(self.lines.shape[1])).real.T.ravel()
        state[len(self.lines) :] *= self.frequency / self.period
        return state

    def turns(self) -> list[NDArray[np.float64]]:
        """For each coordinate the angles theta at which it turns, and its values there; shape (2, turns) each."""
        from gapwalk.orbit.harmonic_balance.kernels import turns  # numba takes longer to load than all the rest

        phi, _, slopes = grid(self.lines.shape[1] - 1)
        found = [turns(row, phi, slopes) for row in self.lines]
        for row in found:
            row[0] = row[0] * self.period % (PERIOD * self.period)
        return found

    def extremes(self) -> NDArray[np.float64]:
        """Maximum, minimum, mean and root mean square of each coordinate, shape (n, 4)."""
        mean = self.lines[:, 0].real
        square = mean**2 + 0.5 * (np.abs(self.lines[:, 1:]) ** 2).sum(axis=1)
        largest, smallest = mean.copy(), mean.copy()
        for index, (_, values) in enumerate(self.turns()):
            if len(values):
                largest[index], smallest[index] = values.max(), values.min()
        return np.column_stack((largest, smallest, mean, np.sqrt(square)))


@lru_cache(maxsize=32)
def _first_values(count: int) -> NDArray[np.complex128]:
    """From lines to the value at 0 and the derivative by phi there, shape (count, 2)."""
    values = np.ones((count, 2), dtype=np.complex128)
    values[:, 1] = 1j * np.arange(count)
    return values
