"""The study of a regime map: which kind of motion there is at each cell of a plane of two parameters."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from gapwalk.attractors.regimes import Regimes
from gapwalk.model.system import System, check_system
from gapwalk.notebook import shows_progress
from gapwalk.orbit.find import initial_state
from gapwalk.parallel.workers import Workers
from gapwalk.studies.kind import values_of
from gapwalk.studies.options import RangeStudy, Second, SecondParameter
from gapwalk.studies.regime_work import Plan, RegimeMapOptions, RegimeWork
from gapwalk.studies.runner import Report, call
from gapwalk.studies.tables import Resolution, RestOrState, check_parameters, check_resolution


@dataclass(frozen=True)
class RegimeStudy(RegimeMapOptions, RangeStudy):
    """A regime map: which kind of motion there is at each cell of a plane of two parameters.

    Parameters
    ----------
    parameter, begin, end
        The parameter across, and its range.
    carry, judging, check, seed, workers
        How the map is made, as `gapwalk.RegimeMapOptions`. In a table, the keys of `judging` stand among the others.
    second
        The parameter up, and its range.
    resolution
        Columns and rows of cells.
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    """

    kind: ClassVar[str] = "regimes"
    table_types: ClassVar[Mapping[str, Any]] = {"resolution": Resolution, "start": RestOrState}

    second: Second = field(kw_only=True)
    resolution: tuple[int, int] = (128, 128)
    start: str | tuple[float, ...] = "rest"

    @property
    def plan(self) -> str:
        """What is to be done, in a line."""
        columns, rows = self.resolution
        return f"regimes over {self.range_words} and {self.second.words}, {columns} x {rows} cells"

    def first_system(self, system: System) -> System:
        """The system at the first value of both parameters."""
        return super().first_system(system).at({self.second.parameter: self.second.begin})

    def work(self, system: System) -> RegimeWork:
        """The work on the map."""
        names, within = (self.parameter, self.second.parameter), (self.ends, self.second.ends)
        start = initial_state(system, self.start)
        return RegimeWork(Plan(system, names, within, self.resolution, start, self.judging), self)


@shows_progress(lambda count, part, pace: str(pace))
def regimes(
    system: System,
    plane: Mapping[str, Sequence[float]],
    resolution: int | tuple[int, int] = 128,
    *,
    start: str | Sequence[float] = "rest",
    options: RegimeMapOptions | None = None,
    workers: Workers | int | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
) -> Regimes:
    """The regimes in the plane of two parameters: period, quasi-periodic, chaotic; peak force and impacts.

    At the centre of each cell a motion is followed by the fast flow until it is known what it is. Those that seem
    quasi-periodic get another look with the exact flow, and a sample of all is classified by it, from where the motion
    has come to.

    Parameters
    ----------
    system
        The system.
    plane
        The two parameters and their ranges, the one across first: ``{"frequency": (0.2, 1.2), "mean.q1": (0, 1)}``.
    resolution
        Cells along each axis, or (columns, rows).
    start
        ``"rest"``, or a state at theta = 0: positions, then velocities.
    options
        How the map is made; its ``carry`` says where motions start.
    workers
        Number of local processes, or workers that were started before (`gapwalk.parallel`); by default as the options
        say. The result does not depend on them.
    report
        Called with each chunk of cells when it is done, and is in the file.
    output
        A file to write while the work is done; `gapwalk.load` reads it. If it holds a part of the same job, that is
        continued, and comes to the same result.

    Raises
    ------
    ModelError
        For parameters, ranges or a start that make no sense.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is what there is by then, not `complete`.
    """
    check_system(system, "regimes")
    options = options or RegimeMapOptions()
    names, within = check_parameters(system, plane)
    state = tuple(initial_state(system, start).tolist())
    (first, other), ((low, high), ends) = names, within
    asked = RegimeStudy(
        first,
        low,
        high,
        **values_of(options),
        second=SecondParameter(other, *ends),
        resolution=check_resolution(resolution),
        start=state,
    )
    return call(asked, asked.work(system), system, workers=workers, report=report, output=output).record
