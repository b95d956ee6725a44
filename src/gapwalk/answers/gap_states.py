"""States of a gap in one motion: closed, open, or rattling on one side or on both; and systems whose gaps keep one.

A gap is a contact with a clearance. It is quiet where it never opens and where it never touches; it rattles where it
does both in turn. Only the innermost stage of each side counts: further stages stiffen a contact that is closed. Many
motions are judged by the batch integrator once they have settled.

A motion in which a gap is quiet is also a motion of a system whose gap cannot change its state: its force is given by
the same formula beyond the breakpoint too, as if the parts were glued, or it is always zero. That system is smooth
where the gap would rattle, so that its response shows how far a design is from a quiet gap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Ge
from numpy.typing import NDArray

from gapwalk.attractors.lane_settling import LANE_ERROR, LaneMotion, settle_lanes, starts_at
from gapwalk.attractors.many_motions import ContactFigures, ManyMotions, enough, finite_rows, motions_of
from gapwalk.attractors.regimes import Waited, wait
from gapwalk.attractors.section import Strobe
from gapwalk.attractors.settle import Settled, SettleOptions, judge_returns, settle
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.follow import walk
from gapwalk.bifurcation.isolated.search_starts import spread_starts, state_box
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import EndReason, WalkOptions
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import FlowError, ModelError, NumericalError
from gapwalk.flow.forces import contact_deflections
from gapwalk.flow.motion import Motion, acceleration_names, accelerations_at
from gapwalk.model.bounds import Bounded, Counted
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.laws import Law, Stages
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.orbit.find import find_orbit, orbit_near
from gapwalk.orbit.orbit import Orbit, describe_switch, is_same
from gapwalk.pieces import tell

# Settled motions met by a slow sweep of one parameter, followed as branches where they are periodic.
#
# A slow sweep stays on a stable motion until it ends or loses its stability: at a fold it jumps, at a flip or a
# Neimark-Sacker point another motion leaves, at a graze of a stiff stop either may happen. Up to there the branch is
# walked, which locates the point exactly. Just beyond it a transient is followed until it has settled, from the last
# state of the branch; so the sweep continues where a machine would. Motions that are not periodic, or of a long
# period, are sampled at even steps of the parameter until a periodic motion is found again.

_BEYOND = 0.02  # share of a step beyond a loss of stability at which the transient begins
_FIRST, _LONGEST_SETTLED = 48, 8  # forcing periods before the first look at a transient, and longest period of a sample
_KEPT = 4  # states of a sampled motion that are stored
_STUCK = 8  # walks in succession that may fail to leave their first point


class Direction(StrEnum):
    """Direction in which a sweep changes the parameter."""

    UP = "rising"
    DOWN = "falling"

    @property
    def sign(self) -> int:
        """1 for a rising parameter, -1 for a falling one."""
        return 1 if self is Direction.UP else -1


class SweepBy(StrEnum):
    """How the motions of a slow sweep are followed."""

    CHOSEN = "chosen"
    """By curves, or by steps if more than one gap moves with more than three coordinates."""
    CURVES = "curves"
    """By continuation."""
    STEPS = "steps"
    """By equal steps in time, settled at each value."""


@dataclass(frozen=True, slots=True)
class SlowSweepOptions(Bounded):
    """Options of a slow sweep."""

    steps: Annotated[int, Ge(2)] = 100  #: Steps of the range at which motions without a branch are sampled.
    #: Longest period, in forcing periods, of motions that are followed as branches; longer ones are sampled.
    longest: Counted = 2
    patience: Annotated[int, Ge(16)] = 300  #: The most forcing periods in which a sampled motion may become periodic.
    #: How motions are followed: ``"curves"`` by continuation, with the exact ends of bands; ``"steps"`` settled at each
    #: step by many motions at once, for systems whose gaps interact; ``"chosen"`` by the size of the system.
    by: SweepBy = SweepBy.CHOSEN
    walk: WalkOptions = WalkOptions()  #: Options of the walks.


@dataclass(frozen=True, eq=False)
class Stretch:
    """Stable periodic motions over a stretch of the parameter."""

    branch: Branch  #: The branch, in the direction of the sweep; its last point may lie beyond the loss of stability.
    #: begin, end: Values of the parameter between which it is stable, in the direction of the sweep.
    begin: float
    end: float
    lost: SpecialPoint | None  #: Special point at which it loses its stability; None if it does not.
    why: str  #: Reason why it ends, in words.

    @property
    def points(self) -> tuple[BranchPoint, ...]:
        """Its stable points, in the direction of the sweep."""
        limit = math.inf if self.lost is None else self.lost.point.arclength
        return tuple(point for point in self.branch.points if point.stable and point.arclength <= limit)

    @property
    def special_points(self) -> tuple[SpecialPoint, ...]:
        """Special points on it; the loss of stability is not among them."""
        limit = math.inf if self.lost is None else self.lost.point.arclength
        return tuple(point for point in self.branch.special_points if point.point.arclength < limit)


@dataclass(frozen=True, eq=False)
class Sample:
    """A settled motion at one value of the parameter."""

    value: float  #: Value of the parameter.
    motion: Settled  #: The motion, with its orbit if it is periodic.


@dataclass(frozen=True, eq=False)
class SettledSweep:
    """The motions met by a slow sweep."""

    parameter: str  #: Name of the parameter.
    within: tuple[float, float]  #: Its range, the smaller end first.
    direction: Direction  #: Direction of the sweep.
    #: stretches, samples: Periodic motions that were followed, and motions that were sampled; both in the order of the
    #: sweep.
    stretches: tuple[Stretch, ...]
    samples: tuple[Sample, ...]
    notes: tuple[str, ...] = ()  #: Failures, in sentences.
    name: str = ""  #: How the motions are met if not by a sweep; empty for a sweep.
    #: lanes, contacts: Motions settled by equal steps, in the order of the sweep, in place of stretches and samples;
    #: and the names of the contacts of their figures.
    lanes: tuple[LaneMotion, ...] = ()
    contacts: tuple[str, ...] = ()
    ends: tuple[SweepEnd, ...] = ()  #: Ends between two of these motions that were located exactly.

    @property
    def met(self) -> str:
        """How the motions are met: ``rising``, ``falling``, or otherwise."""
        return self.name or str(self.direction)

    @property
    def pieces(self) -> list[Stretch | Sample]:
        """Stretches and samples in the order of the sweep."""
        both: list[Stretch | Sample] = [*self.stretches, *self.samples]
        return sorted(both, key=lambda piece: self.direction.sign * start_of(piece))


def lane_states(motion: LaneMotion, contacts: Sequence[str], gaps: Sequence[str]) -> list[GapState]:
    """Return the state of each gap in a motion settled by equal steps."""
    sides, closed = motion.sides.tolist(), motion.closed.tolist()
    quiet, rattles = (GapState.OPEN, GapState.CLOSED), (GapState.ONE_SIDE, GapState.BOTH_SIDES)
    places = ((closed[place], sum(each > 0.0 for each in sides[place])) for place in map(contacts.index, gaps))
    return [rattles[hits - 1] if hits else quiet[is_closed] for is_closed, hits in places]


def start_of(piece: Stretch | Sample) -> float:
    """Return the value of the parameter at which a piece of a sweep begins."""
    return piece.begin if isinstance(piece, Stretch) else piece.value


def settled_sweep(
    system: System,
    parameter: str,
    within: tuple[float, float],
    direction: Direction,
    start: str | tuple[float, ...] = "rest",
    options: SlowSweepOptions | None = None,
) -> SettledSweep:
    """Follow the settled motion over a range of a parameter that changes slowly in one direction."""
    options = options or SlowSweepOptions()
    low, high = within
    sweep = _SlowSweep(system, parameter, (min(low, high), max(low, high)), direction, options)
    sweep.run(start)
    return SettledSweep(
        parameter, sweep.within, direction, tuple(sweep.stretches), tuple(sweep.samples), tuple(sweep.notes)
    )


def stable_stretch(
    orbit: Orbit,
    parameter: str,
    to: float,
    options: WalkOptions,
    begin: float | None = None,
    passed: Callable[[float], object] = float,
) -> tuple[Stretch, NDArray[np.float64]]:
    """Follow a stable orbit until it loses its stability or reaches a value of the parameter."""
    steps = walk(orbit, parameter, to, walk=options)
    lost: SpecialPoint | None = None
    for point in steps:
        passed(point.value)
        lost = next((each for each in steps.special_points if not each.before.total and each.after.total), None)
        if lost is not None or not point.stable:
            break
    branch = steps.branch
    last = branch.points[-1]
    first = orbit.system[parameter] if begin is None else begin
    if lost is not None:
        return Stretch(branch, first, lost.value, lost, str(lost.kind)), last.orbit.state
    if not last.stable:  # the point where it was lost could not be located
        values = [point.value for point in branch.points[-2:]]
        return Stretch(branch, first, float(np.mean(values)), None, "the motion becomes unstable"), last.orbit.state
    return Stretch(branch, first, branch.ends[-1].value, None, branch.ends[-1].reason_words), last.orbit.state


class _SlowSweep:
    """A sweep that is being computed."""

    def __init__(
        self,
        system: System,
        parameter: str,
        within: tuple[float, float],
        direction: Direction,
        options: SlowSweepOptions,
    ) -> None:
        self.system, self.parameter, self.within, self.options = system, parameter, within, options
        self.direction = direction
        self.sign = direction.sign
        self.begin, self.end = within if self.sign > 0 else within[::-1]
        self.step = (within[1] - within[0]) / options.steps
        self.stretches: list[Stretch] = []
        self.samples: list[Sample] = []
        self.notes: list[str] = []

    def run(self, start: str | tuple[float, ...]) -> None:
        """Follow the motion from one end of the range to the other."""
        settled = settle(self.system, start, at={self.parameter: self.begin})
        state, value, fails = settled.state, self.begin, 0
        while True:
            orbit = settled.orbit
            if orbit is not None and orbit.period <= self.options.longest and fails < _STUCK:
                before, after = value, self._followed(orbit)
                if after is not None:
                    (value, state), fails = after, 0 if abs(after[0] - before) > _BEYOND * self.step else fails + 1
                    ahead = value + self.sign * _BEYOND * self.step
                else:
                    ahead = self._sampled(value, settled)
            else:
                ahead, fails = self._sampled(value, settled), 0
            if self._is_past(value) or self._is_past(ahead):
                return
            value = ahead
            self._tell(value)
            try:
                settled = self._settled(self.system.at({self.parameter: value}), state)
            except FlowError as error:
                self.notes.append(f"{self.parameter} = {value:.8g}: {error}")
                return
            state = settled.state

    def _settled(self, system: System, state: NDArray[np.float64]) -> Settled:
        """Follow a transient until its returns shrink towards an orbit, which is then found, or to the end of patience.

        Newton's method is called only where returns shrink: in chaos it would be called at every chance return.
        """
        strobe, scales, longest = Strobe(system), system.state_scales(), max(_LONGEST_SETTLED, self.options.longest)
        states, length = state[None, :], max(_FIRST, 3 * longest + 1)
        while True:
            states = np.vstack((states, strobe.run(states[-1], length - (len(states) - 1))))
            tail = states[-min(len(states), length // 2 + 3 * longest) :] / scales
            size = max(float(np.abs(tail).max()), np.finfo(float).tiny)
            period = int(judge_returns(tail[:, None] / size, longest).periods[0])
            state, is_last = states[-1], length >= self.options.patience
            if is_last and not period and (orbit := orbit_near(system, 1, state)):  # some modes outlast any patience
                state, period = orbit.state, 1
            if period:
                settled = settle(system, state, SettleOptions(max_periods=8 * _FIRST, max_period=period))
                if settled.orbit is not None:
                    return replace(settled, periods=settled.periods + length)
            if is_last:
                why = f"it did not become periodic within {length} forcing periods"
                return Settled(system, states, length, False, None, float("inf"), (why,))
            length = min(length + length // 2, self.options.patience)

    def _tell(self, value: float) -> None:
        tell((value - self.begin) / (self.end - self.begin))

    def _is_past(self, value: float) -> bool:
        return (value - self.end) * self.sign >= 0.0

    def _sampled(self, value: float, settled: Settled) -> float:
        """Keep a motion as a sample, and return the next value to look at."""
        self.samples.append(Sample(value, replace(settled, strobes=settled.strobes[-_KEPT:].copy())))
        return value + self.sign * self.step

    def _followed(self, orbit: Orbit) -> tuple[float, NDArray[np.float64]] | None:
        """Follow an orbit; return the value and the state where the stretch ends, None if that fails."""
        value = orbit.system[self.parameter]
        # a motion settled just beyond a loss of stability is there from the very point on
        previous = self.stretches[-1].end if self.stretches else value
        begin = previous if abs(value - previous) <= 1.5 * _BEYOND * self.step else value
        try:
            stretch, state = stable_stretch(orbit, self.parameter, self.end, self.options.walk, begin, self._tell)
        except NumericalError as error:
            self.notes.append(f"{self.parameter} = {value:.8g}: {error}")
            return None
        if not stretch.points or (stretch.end - begin) * self.sign <= 0.0:
            return None
        if stretch.branch.ends[-1].reason is EndReason.FAILED:
            self.notes.append(f"{self.parameter} = {stretch.end:.8g}: {stretch.why}")
        self.stretches.append(stretch)
        return stretch.end, state


WATCHED = 16
"""Forcing periods over which the gaps of many motions are observed; a multiple of most periods."""
_TRANSIENT = 16  # forcing periods after which fewer steps may do: random starts close gaps at great velocities
_LONGEST = 8  # longest period that is distinguished from motions without period
_ABREAST = 32  # motions that are followed at once by equal steps
_RESTS = 1e-9  # share of a clearance by which a deflection that rests on the breakpoint may miss it


class GapState(StrEnum):
    """State of a gap over a whole motion."""

    CLOSED = "closed"
    """It never opens."""
    OPEN = "open"
    """It never touches."""
    ONE_SIDE = "one side"
    """It opens and closes, on one side."""
    BOTH_SIDES = "both sides"
    """It opens and closes on either side."""

    @property
    def rattles(self) -> bool:
        """True if it opens and closes."""
        return self in (GapState.ONE_SIDE, GapState.BOTH_SIDES)

    @property
    def code(self) -> int:
        """Number of the state in arrays: 0 closed, 1 open, 2 one side, 3 both sides."""
        return list(GapState).index(self)


def known_gaps(system: System) -> tuple[str, ...]:
    """Return the names of all contacts of a system that have a gap, in their order."""
    return tuple(
        contact.name
        for contact in system.structure.contacts
        if contact.stages and not contact.law.is_dry and _width(system, contact.name) > 0.0
    )


def usual_gaps(system: System) -> tuple[str, ...]:
    """Return the gaps in which parts may rattle: all gaps, or, in a drive train, those of links that can part."""
    # A link with a spring that acts always, such as a clutch damper with stages, cannot part.
    known, assembly = known_gaps(system), system.structure.assembly
    if isinstance(assembly, TrainAssembly):
        loose = {link.name for link in assembly.form.links if not link.always}
        return tuple(name for name in known if name.split(".", maxsplit=1)[0] in loose) or known
    return known


def chosen_gaps(system: System, gaps: str | Iterable[str] = ()) -> tuple[str, ...]:
    """Return the gaps of a request: those named, each once, or by default `usual_gaps`."""
    known = known_gaps(system)
    if not known:
        raise ModelError("nothing can rattle: no contact of the system has a gap; give one a clearance")
    names = tuple(dict.fromkeys([gaps] if isinstance(gaps, str) else gaps)) or usual_gaps(system)
    for name in names:
        if name not in known:
            contacts = [contact.name for contact in system.structure.contacts]
            what = "has no clearance that could open" if name in contacts else "is no contact of the system"
            raise ModelError(f"gaps names {name!r}, which {what}; {did_you_mean(name, list(known))}")
    return names


def gap_state(motion: Orbit | Motion, gap: str) -> GapState:
    """Return the state of a gap over a whole motion."""
    inner = innermost(motion.system, gap)
    begin = 0.0 if isinstance(motion, Orbit) else float(motion.theta[0])
    # a stop that is let go of at once touches without a force; if the part leaves it, it comes back later
    told = (event.switch for event in motion.events if event.enters or event.theta > begin)
    sides = {inner[switch] for switch in told if switch in inner}
    if sides:
        return GapState.ONE_SIDE if len(sides) == 1 else GapState.BOTH_SIDES
    system, breakpoints = motion.system, motion.system.breakpoints
    theta, q = (0.0, motion.state[: system.size]) if isinstance(motion, Orbit) else (motion.theta[0], motion.q[0])
    place = contact_place(system, gap)
    deflection = float(contact_deflections(layout_of(system.structure), coefficients_of(system), theta, q)[place])
    for switch, side in inner.items():
        clearance = breakpoints[switch][2]
        if side * deflection >= clearance - _RESTS * max(abs(deflection), abs(clearance)):
            return GapState.CLOSED
    return GapState.OPEN


def state_codes(impacts: NDArray[np.float64], is_closed: NDArray[np.bool_]) -> NDArray[np.int_]:
    """Return the states of a gap in many motions, as codes (`GapState.code`)."""
    # Shapes: `impacts` (count, 2); `is_closed` (count,), bool.
    hits = (impacts > 0.0).sum(axis=1)
    quiet = np.where(is_closed, GapState.CLOSED.code, GapState.OPEN.code)
    parted = np.where(hits == 1, GapState.ONE_SIDE.code, GapState.BOTH_SIDES.code)
    codes = np.where(hits == 0, quiet, parted)
    return np.where(np.isnan(impacts).any(axis=1), -1, codes)


def watched(system: System, state: NDArray[np.float64], gaps: Sequence[str]) -> list[GapState]:
    """Return the state of each gap over some forcing periods from a state at theta = 0, by the exact flow."""
    arc = Strobe(system).arc(state, WATCHED)
    motion = Motion.of(system, np.zeros(1), state[None], arc.contacts)
    return [gap_state(motion, gap) for gap in gaps]


class GapVerdicts(NamedTuple):
    """States of gaps in many settled motions."""

    codes: NDArray[np.int_]  #: shape (count, gaps): `GapState.code` of each gap; -1 for motions that have diverged.
    #: shape (count,): Periods of the motions in forcing periods; 0 if they did not become periodic.
    periods: NDArray[np.int_]
    peaks: NDArray[np.float64]  #: shape (count, gaps): Largest magnitude of each contact force; nan on a rigid stop.
    states: NDArray[np.float64]  #: shape (count, state_size): Last states of the motions.
    error: float  #: Error of the integrator over a forcing period of settled motions, relative to their size.
    waited: int  #: Largest number of forcing periods of the transients, before the gaps were observed.
    #: shape (count, gaps): Root mean square acceleration behind each gap; None unless it was made by equal steps.
    rms: NDArray[np.float64] | None = None


def judge_gaps(
    system: System,
    states: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]] | None,
    gaps: Sequence[str],
    patience: int,
) -> GapVerdicts:
    """Follow motions until they are periodic or patience ends, and return what their gaps do then."""
    # Shapes: `states` (count, state_size).
    if prefers_lanes(system):
        return _judge_by_lanes(system, states, values or {}, gaps)
    pace, places = system.structure.pace, [contact_place(system, gap) for gap in gaps]
    paces = (values or {}).get(pace, np.full(len(states), system[pace]))
    scales = np.array([system.state_scales(1.0, system.structure.frequency * each) for each in paces.tolist()])
    motions = motions_of(system, states, values, periods=_TRANSIENT)
    states = motions.advance(states, _TRANSIENT)

    def watch(motions: ManyMotions) -> tuple[Waited, ContactFigures]:
        waited = wait(motions, states, scales, patience, _LONGEST)
        return waited, motions.contacts(waited.states, WATCHED)

    (waited, found), error = enough(motions.eased(states), watch)
    codes = np.stack([state_codes(found.sides[:, place], found.closed[:, place]) for place in places], axis=1)
    peaks = found.peaks[:, places]
    # the force of a deflection within a step from the breakpoint is an average: only the exact flow knows of a touch
    is_near = (codes == GapState.OPEN.code) & (peaks > 0.0)
    for k in np.flatnonzero(is_near.any(axis=1)).tolist():
        here = system.at({name: float(each[k]) for name, each in (values or {}).items()})
        codes[k] = [state.code for state in watched(here, found.states[k], gaps)]
    peaks[codes == GapState.OPEN.code] = 0.0
    peaks[:, [system.structure.contacts[place].law.rebounds for place in places]] = np.nan  # no part of the batch
    periods, length = np.maximum(waited.periods, 0), _TRANSIENT + waited.longest
    return GapVerdicts(codes, periods, peaks, found.states, error, length)


def _judge_by_lanes(
    system: System, states: NDArray[np.float64], values: Mapping[str, NDArray[np.float64]], gaps: Sequence[str]
) -> GapVerdicts:
    """Do the same by equal steps, with their rules for the end of a transient."""
    names, known = [form.name for form in system.structure.equations.contacts], acceleration_names(system)
    places = [names.index(gap) for gap in gaps]
    behind = [[known.index(each) for each in accelerations_at(system, gap)] for gap in gaps]
    count, waited = len(states), 0
    codes, periods = np.full((count, len(gaps)), -1), np.zeros(count, dtype=int)
    (peaks, rms), ends = np.full((2, count, len(gaps)), np.nan), np.full(states.shape, np.nan)
    for start, motion in settle_lanes(starts_at(system, states, values), width=_ABREAST, gaps=gaps):
        waited = max(waited, motion.waited)
        if not motion.diverged:
            k = start.key
            codes[k] = [state.code for state in lane_states(motion, names, gaps)]
            periods[k], peaks[k], ends[k] = motion.period, motion.peak[places], motion.state
            rms[k] = [motion.rms[own].max() for own in behind]
    peaks[codes == GapState.OPEN.code] = 0.0
    return GapVerdicts(codes, periods, peaks, ends, LANE_ERROR, waited, rms)


def contact_place(system: System, gap: str) -> int:
    """Return the number of the contact that is a gap."""
    return [contact.name for contact in system.structure.contacts].index(gap)


def innermost(system: System, gap: str) -> dict[int, int]:
    """Return the side (1 or -1) of each switch that opens and closes a gap, by the number of the switch."""
    place, found = contact_place(system, gap), {}
    for switch, (contact, side, clearance) in enumerate(system.breakpoints):
        if contact == place and (side not in found or clearance < found[side][1]):
            found[side] = (switch, clearance)
    return {switch: side for side, (switch, _) in found.items()}


class _Kept(Law):
    """The force of a contact whose innermost stage on one side is always closed, or, with side 0, all are open.

    The breakpoints stay what they are: crossing one is an event, at which the force does not change.
    """

    name, words = "kept", "a gap that keeps its state"

    def __init__(self, law: Law, side: int) -> None:
        self.law, self.side, self.host = law, side, law.host
        # of one object, as those of the law that it stands for
        self.parameters = law.parameters  # pyright: ignore[reportAttributeAccessIssue]
        self.stage_parameters = law.stage_parameters  # pyright: ignore[reportAttributeAccessIssue]

    def force(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Any:
        """See `Law.force`."""
        if not self.side:
            return 0.0 * rate
        return self.law.force(rate, stages.kept(self.side), numbers)

    @property
    def arguments(self) -> tuple[str, ...]:
        """See `Law.arguments`."""
        return self.law.arguments

    @property
    def mode_count(self) -> int:
        """See `Law.mode_count`."""
        return self.law.mode_count

    def guards(self, rate: Any, stages: Stages, numbers: Mapping[str, Any]) -> Sequence[Any]:
        """See `Law.guards`."""
        return self.law.guards(rate, stages.kept(self.side), numbers)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Kept) and (self.law, self.side) == (other.law, other.side)

    def __hash__(self) -> int:
        return hash((self.law, self.side))

    def __repr__(self) -> str:
        return f"_Kept({self.law!r}, {self.side})"


def kept(system: System, gap: str, side: int) -> System:
    """Return the system whose gap never changes its state; its parameters are the same."""
    structure, place = system.structure, contact_place(system, gap)
    form = structure.contacts[place]
    if side and form.law.rebounds:
        raise ModelError(f"{gap} is a rigid stop, so no motion keeps its gap closed; ask for an open gap")
    contacts = (*structure.contacts[:place], replace(form, law=_Kept(form.law, side)), *structure.contacts[place + 1 :])
    return System.from_values(replace(structure, contacts=contacts), system.values)


def kept_side(system: System, gap: str) -> int | None:
    """Return the side on which a gap is kept closed, 0 if it is kept open; None if it is not kept."""
    law = system.structure.contacts[contact_place(system, gap)].law
    return law.side if isinstance(law, _Kept) else None


def released(system: System) -> System:
    """Return the system without gaps that keep their states."""
    forms = system.structure.contacts
    own = tuple(replace(form, law=form.law.law) if isinstance(form.law, _Kept) else form for form in forms)
    return System.from_values(replace(system.structure, contacts=own), system.values)


def _width(system: System, gap: str) -> float:
    """Return the width of a gap between its sides; infinite if the contact acts on one side only."""
    clearances = [system.breakpoints[switch][2] for switch in innermost(system, gap)]
    return sum(clearances) if len(clearances) == 2 else np.inf


# Spans of a parameter over which a gap does the same, and the bands in which it rattles, with their located ends.
#
# A span ends at a grazing point, where the deflection just reaches a breakpoint; at a jump, where the motion that was
# followed ends or loses its stability and the next one does something else; or between two samples of motions without
# a branch.

_FAR = 1.0  # margin of a gap in chaos (`LaneMotion.margin`) from which it counts as quiet
_LOOK = 64  # forcing periods over which a motion without period is watched

RANGE, BETWEEN, LOST, SELDOM = "end of the range", "between samples", "end of a motion", "seldom parts beyond"


@dataclass(frozen=True, slots=True)
class Mover:
    """A parameter that moves the end of a band."""

    name: str  #: Name of the parameter.
    slope: float  #: Derivative of the end by the parameter, in the units of the model.
    error: float  #: Estimated error of the slope.
    share: float  #: Change of the end in percent for one percent more of the parameter.


@dataclass(frozen=True, eq=False)
class BandEnd:
    """End of a span or a band."""

    value: float  #: Value of the parameter.
    #: ``grazing``; ``fold``, ``flip`` or another kind of special point at which the motion is lost, so that it jumps;
    #: ``end of the range``; ``between samples`` if motions without a branch lie on either side; ``seldom parts
    #: beyond`` where the next motion has no period, and the gap did not part as long as it was watched.
    kind: str
    error: float = 0.0  #: Estimated error of the value; with ``seldom parts beyond``, that of the step alone.
    special: SpecialPoint | None = None  #: The special point; None if there is none.
    movers: tuple[Mover, ...] = ()  #: Parameters that move it, those that move it most first.

    @property
    def is_located(self) -> bool:
        """True if it is a special point of a branch, or of the response with held flanks."""
        return self.special is not None or self.kind == str(Kind.GRAZING)

    def with_movers(self) -> BandEnd:
        """Return the end with the parameters that move it; without them if the point has no gradient."""
        if self.special is None or self.movers:
            return self
        try:
            found = self.special.gradient()
        except (ModelError, NumericalError):
            return self
        shares = found.elasticities
        movers = [
            Mover(found.names[k], float(found.slopes[k]), float(found.errors[k]), float(shares[k])) for k in found.order
        ]
        return replace(self, movers=tuple(movers))


@dataclass(frozen=True, eq=False)
class GapSpan:
    """A span of the parameter over which the state of a gap is the same."""

    #: low, high: Its ends.
    low: BandEnd
    high: BandEnd
    state: GapState  #: The state of the gap.


@dataclass(frozen=True, eq=False)
class RattleBand:
    """A band of the parameter in which a gap rattles."""

    gap: str  #: Name of the contact.
    #: How it is met: ``rising``, ``falling``, or ``any`` for the union over all settled motions that are known.
    met: str
    #: low, high: Its ends.
    low: BandEnd
    high: BandEnd
    #: The spans of equal state in it, in the order of the parameter; those of a union may overlap.
    spans: tuple[GapSpan, ...]

    @property
    def states(self) -> tuple[GapState, ...]:
        """The states of the gap in it, each once."""
        return tuple(state for state in GapState if any(span.state is state for span in self.spans))


def state_of(motion: Orbit | Sample, gap: str) -> GapState:
    """Return the state of a gap in an orbit, or in a sampled motion that need not be periodic."""
    if isinstance(motion, Orbit):
        return gap_state(motion, gap)
    settled = motion.motion
    if settled.orbit is not None:
        return gap_state(settled.orbit, gap)
    watched = Strobe(settled.system).arc(settled.state, _LOOK)  # only its events matter
    return gap_state(Motion.of(settled.system, np.zeros(1), settled.state[None], watched.contacts), gap)


class SweepEnd(NamedTuple):
    """An exact end of a gap's rattle between two motions of a sweep by steps."""

    gap: str  #: Name of the contact.
    #: before, after: Values of the parameter of the motions between which the sweep has it.
    before: float
    after: float
    end: BandEnd  #: The end; the error of a step may move it beyond these values.


class GapLabel(NamedTuple):
    """State of a gap in a motion by equal steps, and whether it is sure."""

    state: GapState
    seldom: bool  #: True if it is left open whether it rattles: it nearly parted, in a motion without period.


def labels_along(motions: Sequence[LaneMotion], contacts: Sequence[str], gap: str) -> list[GapLabel]:
    """Return what a gap does in successive motions of a sweep by steps.

    Between motions that rattle, one without period that did not part as long as it was watched parts seldom.
    """
    labels, place = list[GapLabel](), contacts.index(gap)
    for motion in motions:
        (state,) = lane_states(motion, contacts, [gap])
        is_sure = motion.period or motion.diverged or state.rattles or motion.margin[place] > _FAR
        labels.append(GapLabel(state, not is_sure))
    sure = [k for k, label in enumerate(labels) if not label.seldom]
    for one, other in pairwise(sure):
        if labels[one].state.rattles and labels[other].state.rattles:
            labels[one + 1 : other] = [labels[one]] * (other - one - 1)
    return labels


def _spans_of_lanes(sweep: SettledSweep, gap: str) -> list[GapSpan]:
    motions = [motion for motion in sweep.lanes if not motion.diverged]
    if not motions:
        return []
    labels = labels_along(motions, sweep.contacts, gap)
    known = {(each.before, each.after): each.end for each in sweep.ends if each.gap == gap}
    between, kept, located = list[BandEnd](), [labels[0].state], list[BandEnd]()
    for (one, before), (other, after) in pairwise(zip(motions, labels, strict=True)):
        if after.state is not before.state:
            kind = SELDOM if before.seldom or after.seldom else BETWEEN
            between.append(BandEnd(0.5 * (one.value + other.value), kind, 0.5 * abs(other.value - one.value)))
            located.append(known.get((one.value, other.value), between[-1]))
            kept.append(after.state)
    # a motion that no sweep meets is followed to where it becomes another, mostly within the range
    inside = (motions[k].value for k in (0, -1))
    first, last = (BandEnd(each, LOST if sweep.name and each not in sweep.within else RANGE) for each in inside)
    ends = [first, *located, last]
    if any(sweep.direction.sign * (two.value - one.value) < 0.0 for one, two in pairwise(ends)):
        ends = [first, *between, last]  # spans shorter than the error of a step
    if sweep.direction is Direction.DOWN:
        ends, kept = ends[::-1], kept[::-1]
    return [GapSpan(low, high, state) for (low, high), state in zip(pairwise(ends), kept, strict=True)]


def unsure(sweeps: Sequence[SettledSweep], gap: str) -> list[LaneMotion]:
    """Return the motions without period in which a gap nearly parted, and did not as long as they were watched."""
    return [
        motion
        for sweep in sweeps
        if sweep.lanes
        for motion, label in zip(sweep.lanes, labels_along(sweep.lanes, sweep.contacts, gap), strict=True)
        if label.seldom
    ]


def seldom(sweeps: Sequence[SettledSweep], gap: str) -> str | None:
    """Say how seldom a gap parts where it nearly did, in motions without period; None if there are none."""
    found = unsure(sweeps, gap)
    if not found:
        return None
    low, high = (pick(motion.value for motion in found) for pick in (min, max))
    where = f"at {low:.6g}" if low == high else f"at {len(found)} values from {low:.6g} to {high:.6g}"
    watched = min(motion.watched for motion in found)
    return (
        f"{gap} did not separate {where}, where the motion has no period, within {watched} forcing periods or more: "
        f"with 95 % confidence it separates in less than one of {watched / 3.0:.0f} periods"
    )


def spans_of(sweep: SettledSweep, gap: str) -> list[GapSpan]:
    """Return the spans of a gap along a sweep, in the order of the parameter."""
    if sweep.lanes:
        return _spans_of_lanes(sweep, gap)
    ends: list[BandEnd] = []
    states: list[GapState] = []
    last: Stretch | Sample | None = None
    for piece in sweep.pieces:
        changes = list(_changes(piece, gap))
        state = changes[0][1]
        if last is None:
            ends.append(BandEnd(start_of(piece), RANGE))
            states.append(state)
        elif state is not states[-1]:
            ends.append(_between(last, start_of(piece)))
            states.append(state)
        for end, state in changes[1:]:
            assert end is not None
            ends.append(end)
            states.append(state)
        last = piece
    if last is None:
        return []
    final = last.end if isinstance(last, Stretch) else last.value
    bound = sweep.within[1] if sweep.direction is Direction.UP else sweep.within[0]
    is_whole = abs(final - bound) <= abs(sweep.within[1] - sweep.within[0]) * 1e-9
    if isinstance(last, Sample) or is_whole:  # the next sample would lie beyond the range
        ends.append(BandEnd(bound, RANGE))
    else:
        ends.append(_between(last, final) if last.lost is not None else BandEnd(final, LOST, abs(final - bound)))
    spans = [GapSpan(low, high, state) for (low, high), state in zip(pairwise(ends), states, strict=True)]
    if sweep.direction is Direction.DOWN:
        spans = [GapSpan(span.high, span.low, span.state) for span in reversed(spans)]
    return spans


def bands_of_spans(spans: Sequence[GapSpan], gap: str, met: str) -> tuple[RattleBand, ...]:
    """Return the bands of spans that touch or overlap; the ends of a band are its outermost."""
    bands: list[list[GapSpan]] = []
    high: BandEnd | None = None
    for span in sorted((span for span in spans if span.state.rattles), key=lambda span: span.low.value):
        if high is not None and span.low.value <= high.value + high.error:
            bands[-1].append(span)
            high = max(high, span.high, key=lambda end: end.value)
        else:
            bands.append([span])
            high = span.high
    return tuple(
        RattleBand(gap, met, band[0].low, max((span.high for span in band), key=lambda end: end.value), tuple(band))
        for band in bands
    )


def _between(last: Stretch | Sample, value: float) -> BandEnd:
    """Return the end between a piece of a sweep and the next one, which begins at a value."""
    if isinstance(last, Sample):
        return BandEnd(0.5 * (last.value + value), BETWEEN, 0.5 * abs(value - last.value))
    if last.lost is None:
        return BandEnd(last.end, LOST, abs(value - last.end))
    return BandEnd(last.end, str(last.lost.kind), last.lost.uncertainty, last.lost)


def _changes(piece: Stretch | Sample, gap: str) -> Iterator[tuple[BandEnd | None, GapState]]:
    """Yield the first state of a gap in a piece, then each change of it: the end of the span, and the new state."""
    if isinstance(piece, Sample):
        yield None, state_of(piece, gap)
        return
    points = piece.points
    before = gap_state(points[0].orbit, gap)
    yield None, before
    for one, other in pairwise(points):
        after = gap_state(other.orbit, gap)
        if after is not before:
            specials = [
                each for each in piece.special_points if one.arclength <= each.point.arclength <= other.arclength
            ]
            yield from _through(one.orbit, other.orbit, gap, specials, (one.value, other.value), (before, after))
        before = after


def _through(
    one: Orbit,
    other: Orbit,
    gap: str,
    specials: Iterable[SpecialPoint],
    values: tuple[float, float],
    states: tuple[GapState, GapState],
) -> Iterator[tuple[BandEnd, GapState]]:
    """Yield the changes of a gap between two neighbouring orbits of a branch."""
    # A side that is touched from now on was first touched at the first graze of its breakpoint, and one that is no
    # longer touched was last touched at the last.
    touched = [_touched(orbit, gap) for orbit in (one, other)]
    names = {side: describe_switch(one, switch) for switch, side in innermost(one.system, gap).items()}
    found = []
    for side in sorted(touched[0] ^ touched[1]):
        own = [each for each in specials if each.kind is Kind.GRAZING and each.contact == names[side]]
        if own:
            found.append(own[0] if side in touched[1] else own[-1])
    found.sort(key=lambda each: each.point.arclength)
    ends = [BandEnd(each.value, str(each.kind), each.uncertainty, each) for each in found]
    if not ends:
        ends = [BandEnd(float(np.mean(values)), BETWEEN, 0.5 * abs(values[1] - values[0]))]
    for end in ends[:-1]:  # two sides at once: first one of them
        yield end, GapState.ONE_SIDE
    yield ends[-1], states[1]


def _touched(orbit: Orbit, gap: str) -> set[int]:
    inner = innermost(orbit.system, gap)
    return {inner[event.switch] for event in orbit.events if event.switch in inner}


# Settled motions that slow sweeps do not meet: found from random starts, and followed as far as they are stable.

OTHER = "other"
"""How motions are met that no sweep meets."""
_ALIKE = 0.02  # difference of peak forces, relative to them, up to which motions from several starts count as one


def other_motions(
    system: System,
    sweeps: Sequence[SettledSweep],
    gaps: Sequence[str],
    values: int,
    starts: int,
    seed: int,
    options: SlowSweepOptions,
) -> tuple[list[SettledSweep], list[str]]:
    """Search for settled motions that no sweep has met, and follow them in both directions while they are stable."""
    # At each of some values of the parameter, motions from random starts are followed by the batch integrator until
    # they have settled. Those whose gaps or peak forces differ are settled by the exact flow, and compared with the
    # sweeps.
    if not values or not starts or not sweeps:
        return [], []
    parameter, within = sweeps[0].parameter, sweeps[0].within
    low, high = within
    found: list[SettledSweep] = []
    notes: list[str] = []
    for number, value in enumerate(np.linspace(low, high, values + 2)[1:-1].tolist()):
        here = system.at({parameter: value})
        try:
            settled = list(_settled(here, gaps, starts, seed + number, options))
        except FlowError as error:
            notes.append(f"{parameter} = {value:.6g}: {error}")
            continue
        for state in settled:
            try:
                motion = settle(here, state, SettleOptions(max_periods=options.patience, max_period=8))
                orbit = motion.orbit
                if orbit is None or orbit.period > options.longest:
                    continue
                if any(_passes(sweep, orbit, value) for sweep in (*sweeps, *found)):
                    continue
                for direction in Direction:
                    end = within[1] if direction is Direction.UP else within[0]
                    stretch, _ = stable_stretch(orbit, parameter, end, options.walk)
                    found.append(SettledSweep(parameter, within, direction, (stretch,), (), name=OTHER))
            except (NumericalError, FlowError) as error:
                notes.append(f"{parameter} = {value:.6g}: a motion from a random start: {error}")
    count = len(found) // len(Direction)
    what = f"{count or 'no'} motion{'s' * (count > 1)} beyond those of the sweeps"
    notes.append(f"{starts} random starts at each of {values} values led to {what}")
    return found, notes


def _settled(
    system: System, gaps: Sequence[str], starts: int, seed: int, options: SlowSweepOptions
) -> Iterator[np.ndarray]:
    """Yield a state of each periodic motion on which random starts settle, distinguished by period, gaps and force."""
    # Motions without period, or of a long one, are left to the samples of the sweeps.
    states = np.array(spread_starts([system], state_box(system), starts, seed, 0.0))
    found = judge_gaps(system, states, None, gaps, options.patience)
    known: list[tuple[int, tuple[int, ...], np.ndarray]] = []
    is_short = (found.periods > 0) & (found.periods <= options.longest)
    for index in np.flatnonzero(finite_rows(found.states) & is_short).tolist():
        own = int(found.periods[index]), tuple(found.codes[index].tolist()), found.peaks[index]
        alike = (each[2] for each in known if own[:2] == each[:2])
        if any(np.allclose(own[2], each, rtol=_ALIKE, atol=0.0, equal_nan=True) for each in alike):
            continue
        known.append(own)
        yield found.states[index]


def _passes(sweep: SettledSweep, orbit: Orbit, value: float) -> bool:
    """Return True if a sweep passes through an orbit."""
    for piece in sweep.pieces:
        if isinstance(piece, Sample):
            if piece.value == value and piece.motion.orbit is not None and is_same(piece.motion.orbit, orbit):
                return True
            continue
        covers = min(piece.begin, piece.end) <= value <= max(piece.begin, piece.end)
        if covers and piece.branch.period == orbit.period and _is_on(piece, orbit, value):
            return True
    return False


def _is_on(stretch: Stretch, orbit: Orbit, value: float) -> bool:
    near = min(stretch.points, key=lambda point: abs(point.value - value)).orbit
    try:
        there = find_orbit(orbit.system, orbit.period, near.state)
    except NumericalError:
        return False
    return is_same(there, orbit)
