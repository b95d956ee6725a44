"""Options of the batch integrator: accuracy and number of threads."""

from __future__ import annotations

import os
from dataclasses import dataclass

from gapwalk.errors import ModelError

MOST_STEPS = 20_000
"""Steps per forcing period above which the exact flow is faster."""


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """Accuracy and threads of the batch integrator.

    Parameters
    ----------
    error
        The allowed error over one forcing period: the root mean square, over the trajectories and periods that are
        compared with the exact flow, of the largest difference in any component of the state, in units of the largest
        value of that component.
    steps
        Steps per forcing period. By default they are chosen for `error`; if given, the error is only reported.
    sample
        Number of trajectories that are compared with the exact flow, at several times of each run.
    threads
        Number of threads; by default all local cores. The result does not depend on it.
    """

    error: float = 1e-4
    steps: int | None = None
    sample: int = 16
    threads: int | None = None

    def __post_init__(self) -> None:
        if not 1e-10 <= self.error <= 0.1:
            raise ModelError(
                f"error is {self.error}; it must be a number from 1e-10 to 0.1. For motions exact to rounding use "
                "gapwalk.integrate"
            )
        for name, least, most in (("steps", 8, MOST_STEPS), ("sample", 1, 10_000), ("threads", 1, 4096)):
            value = getattr(self, name)
            if value is None and name != "sample":
                continue
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise ModelError(f"{name} is {value!r}; it must be an integer from {least} to {most}")

    @property
    def hands(self) -> int:
        """Number of threads."""
        if self.threads is not None:
            return self.threads
        if hasattr(os, "sched_getaffinity"):  # not on macOS
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1
