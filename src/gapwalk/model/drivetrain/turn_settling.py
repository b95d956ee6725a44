"""The slow return of a train's rotation as a whole to its mean, which settling takes to where it ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.system import System


def steadied(system: System, strobes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the last of some states, one forcing period apart, with the turn where it would end if all else repeated.

    The turn returns to its mean within thousands of periods. It is exact where the motion is periodic: with the matrix
    A of its own two equations over a period, the turn ``z' = A z + b`` ends at ``(1 - A)^-1 b``. Shapes: `strobes`
    (2 or more, state_size).
    """
    assembly, n = system.structure.assembly, system.size
    if not isinstance(assembly, TrainAssembly) or not assembly.form.has_turn:
        return strobes[-1]
    numbers = assembly.numbers(system.values)
    ends, fast = numbers.decay * numbers.whole + numbers.steadying, numbers.hold / numbers.whole
    decay = ends / numbers.whole
    rates = np.roots([1.0, decay, fast])
    duration = 2.0 * np.pi / numbers.values[0]
    vectors = np.array([[1.0, 1.0], rates])
    across = np.real(vectors * np.exp(rates * duration) @ np.linalg.inv(vectors))
    turn = strobes[:, [n - 1, 2 * n - 1]]
    left = np.mean(turn[1:] - turn[:-1] @ across.T, axis=0)
    found = strobes[-1].copy()
    found[[n - 1, 2 * n - 1]] = np.linalg.solve(np.eye(2) - across, left)
    return found
