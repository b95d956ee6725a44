"""Drives a sweep: up and down over a parameter with the state carried over, or afresh from many starts."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

from gapwalk.errors import Interrupted
from gapwalk.model.system import System, check_system
from gapwalk.notebook.progress_line import shows_progress
from gapwalk.parallel.pace import Pace
from gapwalk.parallel.workers import Workers, workers
from gapwalk.results.faults import undamaged
from gapwalk.studies.request import Output, call_file
from gapwalk.studies.sweep.call import STRETCH, SweepCall, place_of, segments
from gapwalk.studies.sweep.driver import Driver, Report
from gapwalk.studies.sweep.options import SweepOptions
from gapwalk.studies.sweep.record import Sweep
from gapwalk.studies.sweep.segment import SweepSegment


@shows_progress(lambda count, part, pace: str(pace))
def sweep(
    system: System,
    parameter: str,
    to: tuple[float, float],
    *,
    options: SweepOptions | None = None,
    hands: Workers | None = None,
    report: Report | None = None,
    output: Output = None,
) -> Sweep:
    """Drive a sweep over a range of one parameter.

    At each value the transient is let settle, for as long as it takes, and section points are recorded. The state is
    carried over exactly to the next value, up to a tiny kick.

    Parameters
    ----------
    system
        The system; its own value of the parameter plays no role.
    parameter, to
        Name of the parameter, and the range.
    options
        How it is driven.
    hands
        Who does the work; by default as many local processes as the options say, or a cluster inside of
        `gapwalk.on_cluster`. The result does not depend on it.
    report
        Called with each segment of values when it is done, and is in the file.
    output
        A file to write while it is driven; `gapwalk.load` reads it. If it holds a part of the same sweep, that is
        continued, and comes to the same result.

    Raises
    ------
    ModelError
        For an unknown parameter, an empty range, or starts that are no states.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is what there is by then, not `complete`.
    """
    check_system(system, "sweep")
    driver = Driver(system, parameter, to, options or SweepOptions())
    with call_file(SweepCall.of(driver), output) as file:
        with undamaged(file.path):
            driver.take(segments(file.known(STRETCH), driver))

        def keep(segment: SweepSegment, pace: Pace) -> None:
            file.write(STRETCH.entry(segment, place_of(segment, driver)))
            if report is not None:
                report(segment, pace)

        try:
            if not driver.is_complete:
                with _executor(driver.options, hands) as found:
                    driver.drive(found, keep)
        except KeyboardInterrupt:
            raise Interrupted(driver.sweep()) from None
    return driver.sweep()


def _executor(options: SweepOptions, hands: Workers | None) -> AbstractContextManager[Workers]:
    return workers(options.workers) if hands is None else nullcontext(hands)
