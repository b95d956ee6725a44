"""The family: the branches of one system for several values of one parameter, their special points joined.

Method: docs/numerics/families.md
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.branch_start import directions
from gapwalk.continuation.walk_options import WalkOptions
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.system import System
from gapwalk.notebook.progress_line import shows_progress
from gapwalk.orbit.method import Method
from gapwalk.parallel.workers import Workers, workers
from gapwalk.results.faults import undamaged
from gapwalk.studies.family.call import FamilyCall, keep_part, stored_parts
from gapwalk.studies.family.job import FamilyJob, Report, Walk
from gapwalk.studies.family.options import FamilyOptions
from gapwalk.studies.family.over import MemberParameter
from gapwalk.studies.family.record import Family
from gapwalk.studies.request import NoFile, Output, call_file


@shows_progress(lambda count, part, pace: str(pace))
def family(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: MemberParameter | Mapping[str, Sequence[float]],
    *,
    start: str | Sequence[float] = "settle",
    period: int = 1,
    options: FamilyOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    hands: Workers | None = None,
    report: Report | None = None,
    output: Output = None,
) -> Family:
    """The response of one system, repeated for several values of a parameter, with the special points joined.

    Between two neighbouring members each special point is followed along its exact locus: to a special point of the
    next member, to another one with which it meets and vanishes, or out of the range.

    Parameters
    ----------
    system
        The system; its own values of what is walked and of what differs play no role.
    parameter, to
        Along what each member is walked, from the first value to the second.
    over
        What differs from member to member: the values of a parameter, as in ``{"mean.q1": [0.25, 0.3, 0.35]}``, or of
        several that move together. With a name of its own: `MemberParameter`.
    start, period
        Where the branches start, as in `find_orbit`.
    options, walk, method
        How far the members go, and how their special points are joined; options of the walk and of the method.
    hands
        Who does the work; by default as many local processes as the options say, or a cluster inside of
        `gapwalk.on_cluster`. The result does not depend on it.
    report
        Called with each part when it is done, and is in the file.
    output
        A file to write while the work is done; `gapwalk.load` reads it. If it holds a part of the same family, that is
        continued, and comes to the same result.

    Raises
    ------
    ModelError
        For unknown parameters, values that the system cannot have, or an empty range.
    StoreError
        If the file is of something else, is being written by another run, or cannot be written.
    WorkError
        If other processes cannot do the work; what they have done is in the file.
    Interrupted
        After Ctrl-C; its `found` is what there is by then, not `complete`.
    """
    over, options = MemberParameter.of(over), options or FamilyOptions()
    begin, end = (float(value) for value in to)
    for value in (begin, end):
        system.at({parameter: value})
    directions(begin, end)  # refuses an empty range
    over.check(system, parameter)
    _check_kinds(options)
    how = Walk(begin, end, start, period, walk, method)
    blank = Family(system, parameter, (min(begin, end), max(begin, end)), over)
    job = FamilyJob(blank, how, options)
    with call_file(FamilyCall.of(job), output) if output is not None else nullcontext(NoFile()) as file:
        with undamaged(file.path):
            job.take(*stored_parts(file.known, job))
        try:
            if not job.family.complete:
                with workers(options.workers) if hands is None else nullcontext(hands) as found:
                    job.work(found, lambda number, part: keep_part(file, job, number, part), report)
        except KeyboardInterrupt:
            raise Interrupted(job.family) from None
    return job.family


def _check_kinds(options: FamilyOptions) -> None:
    """A ModelError if nothing can be joined as it is asked for."""
    if options.exact and set(options.kinds) == {Kind.BRANCH_POINT}:
        raise ModelError("branch points have no locus; write exact=False to join them by nearness")
