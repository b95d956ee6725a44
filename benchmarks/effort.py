"""How much the benchmark does: everything, or a quick look."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Effort:
    """Numbers of repeats, and sizes of the jobs.

    Parameters
    ----------
    repeats
        Measurements of which the least counts; a baseline that takes longer is repeated less often.
    burst
        CPU seconds that one measurement of something short lasts.
    sizes
        Degrees of freedom of the chains.
    walk_to
        Frequency at which the walk that is compared with SciPy ends; it begins at 0.9.
    diagram_from
        Lowest frequency of the diagram.
    mass_periods
        Forcing periods of each run of the batch integrator.
    cells
        Columns and rows of a regime map.
    """

    repeats: int = 25
    burst: float = 0.01
    sizes: tuple[int, ...] = (2, 5, 10, 20, 50)
    walk_to: float = 0.8
    diagram_from: float = 0.15
    mass_periods: int = 1000
    cells: int = 128


FULL = Effort()
QUICK = Effort(repeats=4, burst=0.003, sizes=(2, 10), walk_to=0.85, diagram_from=1.0, mass_periods=50, cells=32)
