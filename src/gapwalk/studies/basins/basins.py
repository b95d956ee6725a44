"""Basins of attraction: of the cells of a plane of initial states, or of random starts in a box."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext

from gapwalk.attractors.basins import Basins, BasinShares, in_order
from gapwalk.attractors.box import Box, Range, Window
from gapwalk.attractors.neighbours import beside_cells, beside_states
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.system import System, check_system
from gapwalk.notebook.progress_line import shows_progress
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers, workers
from gapwalk.results.faults import undamaged
from gapwalk.studies.basins.call import BASINS, CELLS, BasinsCall
from gapwalk.studies.basins.job import BasinChunk, BasinJob, Report
from gapwalk.studies.basins.options import BasinOptions
from gapwalk.studies.grid import check_resolution
from gapwalk.studies.request import Output, call_file


@shows_progress(lambda count, part, pace: str(pace))
def basins(
    system: System,
    plane: Mapping[str, Sequence[float]],
    resolution: int | tuple[int, int] = 128,
    *,
    fixed: Mapping[str, float] | None = None,
    options: BasinOptions | None = None,
    hands: Workers | None = None,
    report: Report | None = None,
    output: Output = None,
) -> Basins:
    """Basins of attraction in a plane of initial states.

    Each cell is judged by the state at its centre. The batch integrator follows it until it is in the trapping region
    of a known attractor (see `gapwalk.attractors.trapping_region`); the attractors themselves are exact. Cells at
    borders between basins, and samples of the others, are followed again by the exact flow, which corrects labels and
    counts the wrong ones.


    Parameters
    ----------
    system
        The system.
    plane
        The two axes and their ranges, the horizontal one first: ``{"q1": (-4, 4), "q1'": (-4, 4)}``.
    resolution
        Cells along each axis, or (columns, rows).
    fixed
        The other components of the state at theta = 0; those that are not named are 0.
    options
        How the basins are found.
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
        For a plane that makes no sense.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is what there is by then, not `complete`.
    """
    check_system(system, "basins")
    options = options or BasinOptions()
    window = Window.of(system, plane, fixed or {})
    columns, rows = check_resolution(resolution)
    states = window.states((columns, rows))
    job = BasinJob(system, states, options.effort, options.seed)
    with call_file(BasinsCall(system, window, (columns, rows), options), output) as file:
        for _, found in file.known(BASINS):
            return found
        with undamaged(file.path):
            job.take(chunk for _, chunk in file.known(CELLS))

        def keep(chunk: BasinChunk, pace: Pace) -> None:
            file.write(CELLS.entry(chunk, chunk.number))
            if report is not None:
                report(chunk, pace)

        try:
            with nullcontext(hands) if hands is not None else workers(options.workers) as executor:
                job.sort(executor, keep)
                job.check(executor, beside_cells(rows, columns), options.borders, options.check)
        except KeyboardInterrupt:
            raise Interrupted(_basins(system, job, window, (rows, columns))) from None
        job.complete = True
        found = _basins(system, job, window, (rows, columns))
        file.write(BASINS.entry(found))
    return found


def _basins(system: System, job: BasinJob, window: Window, shape: tuple[int, int]) -> Basins:
    """The basins, as far as the job has come."""
    attractors, labels = in_order(job.catalogue.attractors, job.labels)
    how = (job.checked, job.error, job.complete, tuple(job.notes()))
    return Basins(system, window, labels.reshape(shape), attractors, *how)


def basin_shares(
    system: System,
    box: Mapping[str, Range],
    starts: int = 1000,
    *,
    confidence: float = 0.95,
    options: BasinOptions | None = None,
    hands: Workers | None = None,
    report: Report | None = None,
) -> BasinShares:
    """The shares of a box of initial states that lead to each attractor, with confidence limits.

    Parameters
    ----------
    system
        The system.
    box
        A range or a fixed value for components of the state at theta = 0: ``{"q1": (-4, 4), "q1'": (-4, 4), "q3": 1}``;
        those that are not named are 0.
    starts
        Number of random starts, evenly distributed over the box.
    confidence
        Probability with which the limits of a share hold.
    options
        How the basins are found. A start is at a border if its label differs from that of one of those nearest to it.
    hands, report
        As in `basins`.

    Raises
    ------
    ModelError
        For a box that makes no sense.
    WorkError
        If other processes cannot do the work.
    Interrupted
        After Ctrl-C; its `found` is what there is by then, not `complete`.
    """
    options = options or BasinOptions()
    room = Box.of(system, box)
    if not room.free:
        raise ModelError('all components of the box are fixed; give at least one a range, such as {"q1": (-4, 4)}')
    if isinstance(starts, bool) or not isinstance(starts, int) or starts < 1:
        raise ModelError(f"starts is {starts!r}; it must be an integer >= 1")
    if not 0.0 < confidence < 1.0:
        raise ModelError(f"confidence is {confidence!r}; it must lie between 0 and 1, such as 0.95")
    states = room.draw(starts, options.seed)
    job = BasinJob(system, states, options.effort, options.seed)
    try:
        with nullcontext(hands) if hands is not None else workers(options.workers) as executor:
            job.sort(executor, report)
            job.check(executor, beside_states(states), options.borders, options.check)
    except KeyboardInterrupt:
        raise Interrupted(_shares(system, job, room, confidence)) from None
    job.complete = True
    return _shares(system, job, room, confidence)


def _shares(system: System, job: BasinJob, room: Box, confidence: float) -> BasinShares:
    """The shares, as far as the job has come."""
    attractors, labels = in_order(job.catalogue.attractors, job.labels)
    how = (confidence, job.complete, tuple(job.notes()), job.checked, job.error)
    return BasinShares(system, room, job.states, labels, attractors, *how)
