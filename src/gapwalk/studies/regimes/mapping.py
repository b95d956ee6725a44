"""The regime map: which kind of motion there is at each cell of a plane of two parameters, and how it rattles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext

from gapwalk.attractors.regimes import Regimes
from gapwalk.errors import Interrupted
from gapwalk.model.system import System, check_system
from gapwalk.notebook.progress_line import shows_progress
from gapwalk.orbit.find import initial_state
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers, workers
from gapwalk.results.faults import undamaged
from gapwalk.studies.grid import check_parameters, check_resolution
from gapwalk.studies.regimes.call import CELLS, REGIMES, RegimesCall, job_of
from gapwalk.studies.regimes.job import RegimeChunk, Report
from gapwalk.studies.regimes.options import RegimeMapOptions
from gapwalk.studies.request import Output, call_file


@shows_progress(lambda count, part, pace: str(pace))
def regimes(
    system: System,
    plane: Mapping[str, Sequence[float]],
    resolution: int | tuple[int, int] = 128,
    *,
    start: str | Sequence[float] = "rest",
    options: RegimeMapOptions | None = None,
    hands: Workers | None = None,
    report: Report | None = None,
    output: Output = None,
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
    hands
        Who does the work; by default as many local processes as the options say, or a cluster inside of
        `gapwalk.on_cluster`. The result does not depend on it.
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
    call = RegimesCall(system, names, within, check_resolution(resolution), state, options)
    job = job_of(call)
    with call_file(call, output) as file:
        for _, found in file.known(REGIMES):
            return found
        with undamaged(file.path):
            job.take(chunk for _, chunk in file.known(CELLS))

        def keep(chunk: RegimeChunk, pace: Pace) -> None:
            file.write(CELLS.entry(chunk, chunk.number))
            if report is not None:
                report(chunk, pace)

        try:
            with nullcontext(hands) if hands is not None else workers(options.workers) as executor:
                job.judge(executor, keep)
                job.check(executor, options.check, options.seed)
        except KeyboardInterrupt:
            raise Interrupted(job.record()) from None
        job.complete = True
        found = job.record()
        file.write(REGIMES.entry(found))
    return found
