"""The regime map: which kind of motion there is at each cell of a plane of two parameters, and how it rattles."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import asdict, dataclass, field
from enum import StrEnum

from gapwalk.attractor.judge import RegimeOptions
from gapwalk.attractor.regimes import Regimes
from gapwalk.errors import Interrupted, ModelError
from gapwalk.model.system import System, check_system
from gapwalk.notebook.progress import shows_progress
from gapwalk.orbit.find import initial_state
from gapwalk.study.grid import check_parameters, check_resolution
from gapwalk.study.regimes.job import Places, Plan, RegimeChunk, RegimeJob, Report
from gapwalk.study.regimes.store import plain_regimes, regime_arrays, regimes_of
from gapwalk.study.store.cell_store import CellStore
from gapwalk.study.store.trust import undamaged
from gapwalk.study.work.pace import Pace
from gapwalk.study.work.workers import Workers, workers


class Carry(StrEnum):
    """Where the motion at a cell starts."""

    NO = "no"
    """At each cell from the same state."""
    UP = "up"
    """From where the motion came to at the cell before it, with the first parameter rising."""
    DOWN = "down"
    """The same with the first parameter falling."""


@dataclass(frozen=True, slots=True)
class RegimeMapOptions:
    """How a regime map is made.

    Parameters
    ----------
    carry
        Where the motions start: ``"no"``: all from the same state. ``"up"`` or ``"down"``: the state is carried over
        along the first parameter, as in a sweep.
    judging
        How regimes are told apart.
    check
        Cells that are settled and classified again with the exact flow.
    seed
        Of the choice of those cells.
    workers
        Processes to work in; by default one for each local core. The result does not depend on it.
    """

    carry: Carry = Carry.NO
    judging: RegimeOptions = field(default_factory=RegimeOptions)
    check: int = 64
    seed: int = 0
    workers: int | None = None

    def __post_init__(self) -> None:
        if self.carry not in list(Carry):
            raise ModelError(f'carry is {self.carry!r}; write "no", "up" or "down"')
        object.__setattr__(self, "carry", Carry(self.carry))
        for name in ("check", "seed"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < 0:
                raise ModelError(f"{name} is {value!r}; it must be an integer >= 0")


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
    hands
        Who does the work; by default as many local processes as the options say, or a cluster inside of
        `gapwalk.on_cluster`. The result does not depend on it.
    report
        Called with each chunk of cells when it is done, and is in the file.
    output
        A file to write while the work is done; `gapwalk.load_regimes` reads it. If it holds a part of the same job,
        that is gone on with, and comes to the same result.

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
    state = initial_state(system, start)
    plan = Plan(system, names, within, check_resolution(resolution), state, options.judging)
    places = places_of(plan, options.carry)
    job = RegimeJob(plan, places)
    with ExitStack() as stack:
        store = None
        if output is not None:
            store = stack.enter_context(
                CellStore(output, plain_regimes(plan, asdict(options), len(places)), len(places))
            )
            with undamaged(output):
                if store.result is not None:
                    return regimes_of(system, names, within, store.result)
                job.take([RegimeChunk.of(number, arrays) for number, arrays in store.chunks.items()])

        def keep(chunk: RegimeChunk, pace: Pace) -> None:
            if store is not None:
                store.add(chunk.number, chunk.arrays)
            if report is not None:
                report(chunk, pace)

        try:
            with nullcontext(hands) if hands is not None else workers(options.workers) as crew:
                job.judge(crew, keep)
                job.check(crew, options.check, options.seed)
        except KeyboardInterrupt:
            raise Interrupted(job.record()) from None
        job.complete = True
        found = job.record()
        if store is not None:
            store.finish(regime_arrays(found))
    return found


def places_of(plan: Plan, carry: Carry) -> list[Places]:
    """The cells of a map in chunks."""
    return plan.cells() if carry is Carry.NO else plan.lines(rising=carry is Carry.UP)
