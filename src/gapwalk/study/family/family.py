"""The family: the branches of one system for several values of one parameter, their special points joined."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, nullcontext

from gapwalk.bifurcation.branch import Kind
from gapwalk.bifurcation.departure import directions
from gapwalk.continuation.options import WalkOptions
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.system import System
from gapwalk.notebook.progress import shows_progress
from gapwalk.orbit.equation import Method
from gapwalk.study.family.job import FamilyJob, Report, Walk
from gapwalk.study.family.options import FamilyOptions
from gapwalk.study.family.over import Over
from gapwalk.study.family.record import Family
from gapwalk.study.family.store import FamilyStore
from gapwalk.study.work.workers import Workers, workers


@shows_progress(lambda count, part, pace: str(pace))
def family(
    system: System,
    parameter: str,
    to: tuple[float, float],
    over: Over | Mapping[str, Sequence[float]],
    *,
    start: str | Sequence[float] = "settle",
    period: int = 1,
    options: FamilyOptions | None = None,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    hands: Workers | None = None,
    report: Report | None = None,
    output: str | os.PathLike[str] | None = None,
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
        several that move together. With a name of its own: `Over`.
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
        A file to write while the work is done; `gapwalk.load_family` reads it. If it holds a part of the same family,
        that is gone on with, and comes to the same result.

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
    over, options = Over.of(over), options or FamilyOptions()
    begin, end = (float(value) for value in to)
    for value in (begin, end):
        system.at({parameter: value})
    directions(begin, end)  # refuses an empty range
    over.check(system, parameter)
    _check_kinds(options)
    how = Walk(begin, end, start, period, walk, method)
    blank = Family(system, parameter, (min(begin, end), max(begin, end)), over)
    job = FamilyJob(blank, how, options)
    with ExitStack() as stack:
        store = None if output is None else stack.enter_context(FamilyStore(output, job))
        if store is not None:
            job.take(store.members, store.joints)
        try:
            if not job.family.complete:
                with workers(options.workers) if hands is None else nullcontext(hands) as found:
                    job.work(found, (lambda number, part: None) if store is None else store.add, report)
        except KeyboardInterrupt:
            raise Interrupted(job.family) from None
    return job.family


def _check_kinds(options: FamilyOptions) -> None:
    """A ModelError if nothing can be joined as it is asked for."""
    if options.exact and set(options.kinds) == {Kind.BRANCH_POINT}:
        raise ModelError("branch points have no locus; write exact=False to join them by nearness")
