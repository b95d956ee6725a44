"""Continuation of an orbit along a parameter: the walk with its special points, returned as a finished branch."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.branch_start import (
    BranchStart,
    directions,
    has_merged,
    has_parent,
    is_close,
    lift,
    refined,
    start_branch,
    switch,
    value_ahead,
    value_between,
)
from gapwalk.bifurcation.detector import Detector, DetectorState, as_one, unexplained
from gapwalk.bifurcation.friction_along_branch import (
    HeldChange,
    beyond_slip,
    bounds_reached,
    changes_between,
    come_to_rest,
    directions_left,
    end_of_slip,
    first_change,
    go_on_with,
    held_in,
    never_slipping_springs,
    never_slips,
    slipping_beside,
)
from gapwalk.bifurcation.graze_throughout import pass_throughout
from gapwalk.bifurcation.kinds.user_event import Event, check_events
from gapwalk.bifurcation.special_point import EXACT, ErrorEstimator, Kind, SpecialPoint, Zero, location_error
from gapwalk.bifurcation.steps_over_corners import (
    AT_START,
    coincidence,
    discontinuity_ahead,
    graze_ahead,
    pass_corner,
    pass_graze,
    pass_start,
    starts_among_impacts,
)
from gapwalk.continuation.corrector import Corrector
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.continuation.walk import (
    End,
    EndReason,
    Tracing,
    TracingState,
    Walk,
    WalkOptions,
    WalkState,
    in_one_direction,
)
from gapwalk.errors import ModelError, NumericalError
from gapwalk.flow.equations import magnitude
from gapwalk.flow.event_rule import jumping_switches
from gapwalk.flow.flow import PERIOD
from gapwalk.flow.symmetry import Symmetry, finds_all, symmetries_of
from gapwalk.model.system import System
from gapwalk.notebook import shows_progress
from gapwalk.orbit.floating import floats, unheld
from gapwalk.orbit.floquet import largest_move
from gapwalk.orbit.method import Method, chosen
from gapwalk.orbit.orbit import Orbit, describe_switch
from gapwalk.orbit.shooting import ShootingEquation

# Branch tracer: a walk with its special points, step by step, that can be stopped after any step and resumed.

_GRAZES = 1e-5  # distance from a breakpoint, relative to the motion, within which a deflection counts as grazing
_AHEAD = 1e-4  # arclength beyond the beginning of a branch from which special points are detected
_SHARP = 1e-6  # length of a step below which a graze is passed in terms of its depth, not of the arclength
_NEARER, _NEAREST = 0.1, 1e-8  # factor on _AHEAD if a contact grazes before it, and its smallest value

_SYMMETRIC, _LOST = 1e-6, 1e-4  # defect of a symmetry, in amplitudes: of an orbit that has it, and that has lost it
_RESTORED = 1e-3  # defect at the vertex where a symmetry returns: it is located to the square of that, and better
_ROUNDING = 1e-8  # size of motions whose asymmetry is rounding, in the scale of positions
_CERTAIN = 1e-6  # arclength of a step that is not repeated, whatever it leaves unexplained
_AT_ONCE = 1e-7  # arclength between the onsets of slip in both directions that are one
_GROWN = 1e5  # multiplier above which a graze of a force that jumps is sought ahead
_LARGE = 1e4  # multiplier that is stated where a walk gets stuck, after it was tried in more segments
_FAR = 0.8  # allowed change of a multiplier in one step: half a turn takes four steps

Step = tuple[BranchPoint, list[SpecialPoint]]
"""New point of a branch, and the special points between it and the point before."""


class BranchTracerState(NamedTuple):
    """Progress of a branch tracer: its walk and its detector."""

    walk: WalkState
    detector: DetectorState


def _change(first: BranchPoint, second: BranchPoint) -> float:
    """Return the change of multipliers between two neighbouring points, as a share of the change allowed in a step."""
    # A multiplier may jump to 0 where friction begins to stick, and that of what it kept is no longer known to be 1.
    change = largest_move(first.orbit.free_multipliers, second.orbit.free_multipliers) / _FAR
    return min(1.0, change) if changes_between(first.orbit, second.orbit) != [] else change


def _is_one_of_several(first: BranchPoint, special: Sequence[SpecialPoint], place: int) -> bool:
    """Return True if one of several springs in series that never slip begins to, in one direction only."""
    # Steps beyond would lead a little into the continuum and back, and its position would no longer be that of the
    # path: that of another one, which depends on it, would differ by far more than any stated error.
    onset, contacts = special[place], first.orbit.system.structure.contacts
    if onset.kind is not Kind.SLIP_ONSET:
        return False
    name = onset.contact.rpartition(" ")[0]
    own = next(number for number, contact in enumerate(contacts) if contact.name == name)
    still = {each for each in onset.point.orbit.friction if never_slips(onset.point.orbit, each)} | {own}
    if own not in first.orbit.stuck or own not in first.orbit.system.structure.memories or len(still) < 2:
        return False
    away = [
        abs(each.point.arclength - onset.point.arclength) for each in special if each.contact.startswith(f"{name} ")
    ]
    return sum(each < _AT_ONCE for each in away) < 2


class BranchTracer(Iterator[Step]):
    """Tracer of a branch in one direction: yields each point with the special points before it."""

    def __init__(
        self,
        beginning: BranchStart,
        walk: WalkOptions | None = None,
        resume: BranchTracerState | None = None,
        events: Sequence[Event] = (),
        *,
        judges: bool = True,
    ) -> None:
        self._judges = judges
        state = resume and resume.walk
        while state is not None and len(beginning.first.x) < len(state.point.x):
            finer = refined(beginning)
            if finer is None:
                break
            if state.previous is not None and len(state.previous.x) < len(finer.first.x):
                state = replace(state, previous=lift(state.previous, finer.corrector), earlier=None)
            elif state.earlier is not None and len(state.earlier.x) < len(finer.first.x):
                state = replace(state, earlier=lift(state.earlier, finer.corrector))
            beginning = finer
        self.beginning, self.first = beginning, beginning.first
        self._kinds = (*Kind.known(), *events)
        self.is_level = False
        self.walk = self._walk_from(walk or WalkOptions(), state)
        self._symmetries: dict[Symmetry, tuple[int, ...]] | None = None
        self.detector = Detector(beginning.corrector, self._kinds)
        self._ways = unheld(self.first.orbit.system)
        if resume is not None:
            self.detector.restore(resume.detector)
        self._hold(self.walk.point)
        if why := floats(self.walk.point.orbit, self._ways):
            self.walk.finish(self.walk.point, EndReason.FLOATING, why)

    @property
    def state(self) -> BranchTracerState:
        """Progress so far; a tracer made with it as `resume` continues as if never stopped."""
        return BranchTracerState(self.walk.state, self.detector.state)

    @property
    def end(self) -> End | None:
        """End of the walk, with its reason; None while it continues."""
        return self.walk.end

    @end.setter
    def end(self, end: End) -> None:
        self.walk.end = end

    def stay_level(self) -> None:
        """Detect only what does not depend on changes of the parameter or on stability: both are rounding here."""
        self.is_level, self._kinds = True, (Kind.BRANCH_POINT, Kind.GRAZING)
        self.detector = Detector(self.beginning.corrector, self._kinds)

    @property
    def is_closed(self) -> bool:
        """True if the branch has closed on itself."""
        return self._ended(EndReason.CLOSED)

    def _ended(self, reason: EndReason) -> bool:
        return self.end is not None and self.end.reason is reason

    def __next__(self) -> Step:
        self.beginning.corrector.forget()
        first, step = self.walk.point, self._pass_impacts()
        step = self._step() if step is None else self._held_on(first, step)
        if step[0] is first and not step[1] and self.end is not None:  # cut off at its parent, with nothing passed
            raise StopIteration
        return step

    def _pass_impacts(self) -> Step | None:
        """Return a step over many impacts at the start of the period; None if it does not lie among them."""
        walk = self.walk
        goes_on = walk.end is None and walk.count < walk.options.max_points
        among = goes_on and starts_among_impacts(walk.point.orbit)
        return self._pass_start(walk.state) if among else None

    def _step(self) -> Step:
        state = self.state
        before, first = self.walk.previous, self.walk.point
        while True:
            try:
                point = next(self.walk)
            except StopIteration:
                if self._refine(state.walk.count):
                    before, first, state = None, self.walk.point, self.state
                    continue
                step = self._beyond(before, state.walk) if self.walk.is_stuck else None
                if step is not None:
                    return step
                if self.walk.is_stuck and (self._continues_in_segments(first, state.walk.count) or self.walk.persist()):
                    before, first, state = self.walk.previous, self.walk.point, self.state
                    continue
                if self.walk.is_stuck:
                    self._end_stuck(before, first)
                raise
            if why := floats(point.orbit, self._ways):
                self.walk.finish(first, EndReason.FLOATING, why)
                continue
            if self._grazes_sharply(first, point):
                step = self._pass_graze(state.walk)
                if step is not None:
                    return self._held_on(first, step)
            inaccuracy = self.beginning.equation.inaccuracy(point.orbit)
            if inaccuracy:
                self.walk.finish(first, EndReason.COARSE, inaccuracy)
                continue
            try:
                step, change, rest = self._examined(first, point, before)
            except NumericalError:
                # no orbits connect the two points: the step went astray, onto another branch
                if self._ends_at_parent(before, first):
                    return first, []
                self.detector.restore(state.detector)
                self.walk.go_back(state.walk, point)
                continue
            return self._held_on(first, step, change) if rest is None else self._at_rest(step, rest)

    def _beyond(self, before: BranchPoint | None, state: WalkState) -> Step | None:
        """Return the step by which another method goes on where the walk got stuck, or ends; None if there is none."""
        for pass_by in (self._pass_start, self._pass_graze, self._pass_rest, self._pass_corner):
            if step := pass_by(state):
                return self._held_on(state.point, step)
        if self._jumps(state.point):
            return None
        graze = graze_ahead(self.beginning.corrector, state.point)
        if graze is None or self._ends_at_parent(before, state.point):
            return None
        self.walk.finish(graze.point, EndReason.WITHIN_ROUNDING, graze.contact)
        return graze.point, [graze]

    def _examined(
        self, first: BranchPoint, point: BranchPoint, before: BranchPoint | None
    ) -> tuple[Step, HeldChange | None, HeldChange | None]:
        """Return the step to a point, or to where a spring changes first, with that change or the end of its slip."""
        if has_merged(point):
            raise NumericalError("the step went onto a branch of motions of a shorter period")
        if self._is_astray(first, point):
            raise NumericalError("the step went onto a branch of motions that lack a symmetry of this one")
        corrector = self.beginning.corrector
        rest = end_of_slip(corrector, first, point)
        if rest is not None:
            point = slipping_beside(corrector, rest.point, [rest.contact], -1.0) or first
            if point.arclength <= first.arclength:
                if rest.point.arclength - first.arclength > _CERTAIN:
                    raise NumericalError("no motion is found before the end of slip")
                return (first, []), None, rest
        elif point.orbit.slips:
            point = self.walk.point = come_to_rest(corrector, first, point)
        change = first_change(corrector, first, point) if self._held else None
        if change is not None:
            point, rest = change.point, None
        step = self._until_vertex(point, self._explained(first, point, before))
        return self._until_slip(first, step), change, rest

    def _at_rest(self, step: Step, rest: HeldChange) -> Step:
        """Return the step to where the slip of a spring ends, and go on: it is pushed to a side, or kept there."""
        (last, special), contact = step, rest.contact
        if not self._go_on_in(beyond_slip(rest, self._held)):
            self._give_up(rest.point, "no motion is found beyond the end of slip")
        point = self.walk.point
        return point, [*special, *(self._onset(rest, last, point, contact, side) for side in (1, -1))]

    def _continues_in_segments(self, last: BranchPoint, count: int) -> bool:
        """Continue in several segments if small changes grow so much that shooting in one may fail for that alone."""
        structure, end = last.orbit.system.structure, self.end
        is_dry, is_single = structure.friction, len(last.x) == structure.state_size + 1
        if not last.orbit.is_exact or not is_single or is_dry or abs(last.orbit.multipliers[0]) <= _LARGE:
            return False
        self.walk.finish(last, EndReason.COARSE)
        if self._refine(count):
            return True
        self.walk.end = end
        return False

    def _refine(self, count: int) -> bool:
        """Continue with a finer resolution if the walk ended for lack of it; return whether that was possible."""
        finer = refined(self.beginning) if self._ended(EndReason.COARSE) else None
        point = None if finer is None else lift(self.walk.point, finer.corrector)
        if finer is None or point is None:
            return False
        self.beginning, walk = finer, self.walk
        self.walk = self._walk_from(walk.options, WalkState(None, point, walk.step, count))
        self.walk.rejected = walk.rejected
        self.detector = Detector(finer.corrector, self._kinds)
        return True

    def _walk_from(self, options: WalkOptions, state: WalkState | None) -> Walk:
        start = self.beginning
        return Walk(
            start.first,
            start.within,
            start.corrector,
            options,
            state,
            branched=start.singular,
            change=_change,
            twins=self._with_other_phases,
            asks=True,
        )

    def _with_other_phases(self) -> list[NDArray[np.float64]]:
        """Return the first point with its motion begun at each other phase: a closed branch ends at the first of them.

        Without them a closed branch of period 7 may be walked seven times around, with each special point seven times.
        """
        first, scales = self.beginning.first, self.beginning.corrector.scales[:-1]
        others = self.beginning.equation.with_other_phases(first.orbit)
        return [np.append(unknowns / scales, first.x[-1]) for unknowns in others]

    def _kept(self, point: BranchPoint) -> dict[Symmetry, tuple[int, ...]]:
        """Return the symmetries that all orbits of the branch have, each with the breakpoints that it exchanges."""
        # They are those of its first orbit, or of the next one if the branch begins at another branch.
        #
        # A parameter may break a symmetry of the equations (a mean load does), so the system must have it over the
        # range.
        if self._symmetries is None:
            if self.beginning.singular and point.arclength < _AHEAD:
                return {}
            within, system = self.beginning.within, self.first.orbit.system
            own = symmetries_of(system)
            if own:
                place = system.structure.place(self.beginning.equation.parameter or "")
                ends = [System.beside(system, place, value) for value in (within.low, within.high)]
                kept = set.intersection(*({*symmetries_of(each)} for each in ends))
                own = tuple(each for each in own if each in kept)
            self._symmetries = {
                each: each.moves_switches(point.orbit.system) for each in own if self._defect(each, point) < _SYMMETRIC
            }
        return self._symmetries

    def _is_astray(self, first: BranchPoint, point: BranchPoint) -> bool:
        """Return True if a point lacks a symmetry of the branch, by its extremes or by the closings of its contacts."""
        # Beyond a graze at a stiff stop, the closings show an asymmetry that is too small to be seen in the extremes.
        closings = point.orbit.closings
        return any(
            closings != tuple(closings[switch] for switch in switches) or self._defect(symmetry, point) > _LOST
            for symmetry, switches in self._kept(first).items()
        )

    def _defect(self, symmetry: Symmetry, point: BranchPoint) -> float:
        return symmetry.defect(point.orbit.extremes, _ROUNDING * float(self.beginning.corrector.scales[0]))

    def _explained(self, first: BranchPoint, point: BranchPoint, before: BranchPoint | None) -> list[SpecialPoint]:
        """Return the special points of a step; raise a NumericalError if they do not explain all changes in it."""
        # A shorter step may then show what was missed.
        singular, start = first is self.first and self.beginning.singular, first
        if singular:  # all test functions vanish there: the step is examined from just beyond
            beside = self._beside_beginning(min(_AHEAD, 0.05 * point.arclength))
            if beside is None:
                return []
            start, before = beside, None
        parameter, method = self.beginning.equation.parameter or "", self.beginning.equation.options
        special = self.detector.inspect(start, point, before)
        if point.arclength - first.arclength > _CERTAIN and not singular and not self.is_level:
            for text in unexplained(first, point, special):
                raise NumericalError(text)
            for contact in point.orbit.friction:
                ends = sum(each.kind is Kind.SLIP_ONSET for each in special)
                if len(directions_left(first.orbit, point.orbit, contact)) > ends:
                    name = point.orbit.system.structure.contacts[contact].name
                    raise NumericalError(f"{name} ceases to slip, but not at the position at which it then sticks")
        # only now, as each of them is found again where the step is repeated
        return [each.kind.judged(each, parameter, method) for each in special] if self._judges else special

    def _beside_beginning(self, ahead: float) -> BranchPoint | None:
        """Return a point just beyond the beginning of a branch that begins at another; None if there is none."""
        # If the contacts there already close differently than at the beginning, one grazes in between, and the branch
        # may turn back at once. A nearer point is then taken, so that nothing of it is missed.
        corrector, first = self.beginning.corrector, self.first
        beside = None
        while ahead >= _NEAREST:
            nearer = corrector.point_near(first.x + ahead * first.tangent, first.tangent, ahead)
            beside = nearer or beside
            if nearer is None or not any(first.orbit.closing_changes(nearer.orbit)):
                break
            ahead *= _NEARER
        return beside

    def _grazes_sharply(self, first: BranchPoint, point: BranchPoint) -> bool:
        """Return True if a contact grazes in so short a step, or with such a change, that its stop must be stiff."""
        # Beside the graze of a force that jumps a multiplier grows without bound; farther on, the touch is only
        # rounding.
        if not any(first.orbit.closing_changes(point.orbit)):
            grown = abs(point.orbit.multipliers[0])
            return grown > max(_GROWN, abs(first.orbit.multipliers[0])) and bool(
                jumping_switches(point.orbit.system, friction=False)
            )
        return point.arclength - first.arclength < _SHARP or _change(first, point) > 1.0

    def _pass_graze(self, state: WalkState) -> Step | None:
        """Return the step over a graze from a state of the walk: at a stiff stop the branch turns within rounding."""
        first = state.point
        if first is self.first and self.beginning.singular:
            return None  # two branches begin there, and the depth does not distinguish them
        passage = pass_graze(self.beginning.corrector, first)
        if passage is None or has_merged(passage.point) or self._is_astray(first, passage.point):
            return None
        self.walk.go_on(state, passage.point, 0.5 * passage.distance)
        self.detector = Detector(self.beginning.corrector, self._kinds)  # test functions may have jumped
        return self._until_vertex(passage.point, passage.special)

    def _pass_start(self, state: WalkState) -> Step | None:
        """Return the step over orbits with an event at the start of the period."""
        first, corrector = state.point, self.beginning.corrector
        if first is self.first and self.beginning.singular:
            return None
        passage = pass_start(corrector, self.walk, state, self._kinds)
        if passage is None or self._is_astray(first, passage.point) or has_merged(passage.point):
            return None
        if floats(passage.point.orbit, self._ways):
            return None
        self.walk.go_on(state, passage.point, passage.step)
        if starts_among_impacts(passage.point.orbit):
            self.walk.step = passage.step  # of another section again: the state at the start turns much faster
        self.walk.previous = None  # a cubic from there would pass over the jump of the state
        self.detector = Detector(corrector, self._kinds)
        if passage.end is not None:
            self.walk.point, self.walk.end = passage.point, passage.end
        parameter, method = self.beginning.equation.parameter or "", self.beginning.equation.options
        special = [each.kind.judged(each, parameter, method) for each in passage.special]
        return self._until_vertex(passage.point, special)

    def _pass_rest(self, state: WalkState) -> Step | None:
        """Return the step to where the slip of a spring ends just ahead."""
        try:
            rest = end_of_slip(self.beginning.corrector, state.point)
        except NumericalError:
            return None
        if rest is None:
            return None
        self.walk.go_on(state, rest.point, _CERTAIN)
        return self._at_rest((state.point, []), rest)

    def _pass_corner(self, state: WalkState) -> Step | None:
        """Return the step over a corner: where slip and stick change their sequence, or a graze touches all along."""
        corrector, last = self.beginning.corrector, state.point
        passage = pass_corner(corrector, last) or pass_throughout(corrector, last)
        if passage is None or self._is_astray(state.point, passage.point):
            return None
        if has_merged(passage.point):  # it ends at the corner of its parent
            return (state.point, []) if self._ends_at_parent(state.previous, state.point) else None
        self.walk.go_on(state, passage.point, passage.distance)
        self.detector = Detector(self.beginning.corrector, self._kinds)
        if self._held:  # springs that were pushed along may turn back at the corner
            self._go_on_from(passage.point, self._held, origin=passage.corner)
        return self.walk.point, passage.special

    def _until_vertex(self, point: BranchPoint, special: list[SpecialPoint]) -> Step:
        """Return the step, cut off where the branch joins the branch from which it bifurcates."""
        # It turns back there, and its continuation is the same motion again: shifted by a forcing period beyond a flip,
        # mirrored beyond a symmetry-breaking point.
        for number, each in enumerate(special):
            if each.is_vertex and self._has_parent(each.point):
                self.walk.finish(each.point, EndReason.JOINED)
                return each.point, special[:number]
        return point, special

    def _until_slip(self, first: BranchPoint, step: Step) -> Step:
        """Return the step, cut off where friction that never slipped gives way to one side, and its position is lost.

        The motions beyond are at other positions, at which the force just reaches its bound. What is left of slip of a
        rigid one there is rounding, so they cannot be followed. A spring in series is followed if it is alone.
        """
        point, special = step
        structure = point.orbit.system.structure
        rigid = {contact for contact, switch in structure.reactions if switch < 0}
        slips = {event.contact for event in point.orbit.slips if event.slip}
        given = rigid & slips & {*first.orbit.stuck}
        words, number = "", next((place for place, each in enumerate(special) if each.kind is Kind.SLIP_ONSET), None)
        if not any([phase.mode for phase in point.orbit.friction[contact]] == [0] for contact in given):
            number = next((place for place in range(len(special)) if _is_one_of_several(first, special, place)), None)
            if number is None:
                return step
            still = [each for each in point.orbit.friction if never_slips(special[number].point.orbit, each)]
            names = " and ".join(structure.contacts[each].name for each in still)
            words = f"beyond, where {names} sticks depends on the history; find an orbit there and follow it"
        last = first if number is None else special[number].point
        self.walk.finish(last, EndReason.GIVES_WAY, words)
        return last, special[: 0 if number is None else number + 1]

    @property
    def _held(self) -> dict[int, int]:
        """The springs that never slip, and the bounds to which they are pushed."""
        return held_in(self.beginning.corrector)

    def _hold(self, point: BranchPoint) -> None:
        """Hold those springs that never slip from a point on."""
        if point.orbit.slips and self.walk.end is None and isinstance(self.beginning.equation, ShootingEquation):
            new = [each for each in never_slipping_springs(point.orbit) if each not in self._held]
            sides = {each: bounds_reached(point.orbit, each) for each in new}
            held = {each: reached[0] for each, reached in sides.items() if len(reached) == 1}
            if new:
                self._go_on_from(point, {**self._held, **dict.fromkeys(new, 0), **held})

    def _held_on(self, first: BranchPoint, step: Step, change: HeldChange | None = None) -> Step:
        """Return a step with the springs held that never slip from its end on; go on behind a change of those."""
        if change is not None and step[0] is change.point:
            return self._changed(first, change, step[1])
        step = self._until_parent(first, step)
        self._hold(step[0])
        return (self.walk.point, step[1]) if self.walk.end is None else step

    def _go_on_from(
        self, point: BranchPoint, held: dict[int, int], lead: int | None = None, origin: BranchPoint | None = None
    ) -> bool:
        """Go on from a point with other springs held; return whether there are such motions."""
        return self._go_on_in(go_on_with(self.beginning.corrector, point, held, lead, origin))

    def _go_on_in(self, moved: tuple[Corrector, BranchPoint] | None) -> bool:
        """Go on from a point of another corrector, if there is any; return whether there is."""
        if moved is None:
            return False
        corrector, last = moved
        self.first, walk = (last if self.walk.point is self.first else self.first), self.walk
        self.beginning = replace(self.beginning, corrector=corrector, first=self.first)
        self.walk = self._walk_from(walk.options, WalkState(None, last, walk.step, walk.count))
        self.walk.rejected = walk.rejected
        self.detector = Detector(corrector, self._kinds)
        return True

    def _changed(self, first: BranchPoint, change: HeldChange, special: list[SpecialPoint]) -> Step:
        """Return the step to a change of springs that are held, and go on: they are kept, pushed, or slip both ways."""
        point, corrector, held = change.point, self.beginning.corrector, self._held
        if not change.side:
            self._go_on_from(point, {**held, change.contact: 0})
            return self.walk.point, special
        reached = {each: {*bounds_reached(point.orbit, each), side} - {0} for each, side in held.items()}
        reached[change.contact] |= {change.side}
        slipping = [each for each, sides in reached.items() if len(sides) == 2]
        left = {each: next(iter(sides), 0) for each, sides in reached.items() if each not in slipping}
        last: BranchPoint | None = point
        if slipping:
            free = Corrector(replace(self.beginning.equation, held=()), corrector.scales)
            last = slipping_beside(free, point, slipping)
        goes_on = last is not None and self._go_on_from(
            last, left, change.contact if not slipping else None, point if slipping else None
        )
        if not goes_on:
            self._give_up(point, "no motion is found beyond the onset of slip")
        last, now = self.walk.point, self._held
        onsets = [
            self._onset(change, point, last, each, side)
            for each in reached
            for side in sorted(reached[each] - {held[each]}, reverse=True)
            if each in slipping or now.get(each) == side
        ]
        return last, [*special, *onsets]

    def _give_up(self, point: BranchPoint, detail: str) -> None:
        """End the walk at a point from which shorter steps would not lead farther."""
        self.walk.finish(point, EndReason.STEP, detail)
        self.walk.step = 0.0

    def _onset(
        self, change: HeldChange, before: BranchPoint, after: BranchPoint, contact: int, side: int
    ) -> SpecialPoint:
        """Return the onset or the end of slip of a spring to one side at a change."""
        kind, point, corrector = Kind.SLIP_ONSET, change.point, change.corrector
        name = f"{point.orbit.system.structure.contacts[contact].name} {'+' if side > 0 else '-'}"
        zero = Zero(kind, point, EXACT, change.function, name)
        try:
            error = location_error(zero, ErrorEstimator(corrector), [change.near])
        except NumericalError:
            error = math.inf
        sides = before.orbit.instability, after.orbit.instability
        parameter = self.beginning.equation.parameter or ""
        return SpecialPoint(kind, point, *sides, error, name, kind.nature(before, after) or "", parameter=parameter)

    def _has_parent(self, vertex: BranchPoint) -> bool:
        """Return True if the orbit at a vertex has what those of the branch lack: half their period, or a symmetry."""
        # Only then is there a branch to join. If not all symmetries of the system are known, the vertex is accepted.
        if vertex.orbit.period % 2 == 0 and is_close(vertex):
            return True
        if not finds_all(vertex.orbit.system):
            return True
        kept = self._kept(self.walk.point)
        lost = [each for each in symmetries_of(vertex.orbit.system) if each not in kept]
        return any(self._defect(each, vertex) < _RESTORED for each in lost)

    @property
    def _scale(self) -> float:
        """Scale of the parameter."""
        return float(self.beginning.corrector.scales[-1])

    def _is_doubled(self, point: BranchPoint) -> bool:
        """Return True if a point may be near the parent of a period-doubled branch, and is not its beginning."""
        return point.orbit.period % 2 == 0 and not (point is self.first and self.beginning.singular)

    def _until_parent(self, first: BranchPoint, step: Step) -> Step:
        """Return the step, cut off where a doubled branch passes its parent without a located branch point."""
        point, special = step
        if self._ended(EndReason.JOINED) or not self._is_doubled(first):
            return step
        value = value_between(first, point, self._scale)
        within, equation = self.beginning.within, self.beginning.equation
        if value is None or value not in within or not has_parent(first, equation, value):
            return step
        self.walk.finish(first, EndReason.JOINED, value=value)
        low, high = sorted((first.value, point.value))
        return first, [each for each in special if low <= each.value <= high and not is_close(each.point)]

    def _ends_at_parent(self, before: BranchPoint | None, last: BranchPoint) -> bool:
        """End the walk if its last point is just before the parent of a doubled branch; return whether it is."""
        if before is None or not self._is_doubled(last) or not is_close(last):
            return False
        value = value_ahead(before, last, self._scale)
        if value is None or value not in self.beginning.within or not has_parent(last, self.beginning.equation, value):
            return False
        self.walk.finish(last, EndReason.JOINED, value=value)
        return True

    def _jumps(self, last: BranchPoint) -> bool:
        """End the walk if the motion jumps just ahead; return whether it does."""
        ahead = discontinuity_ahead(self.beginning.corrector, last) if last.orbit.slips else None
        if ahead is None:
            return False
        value = ahead.value if ahead.value in self.beginning.within else last.value
        self.walk.finish(last, EndReason.JUMPS, ahead.words, value)
        return True

    def _end_stuck(self, before: BranchPoint | None, last: BranchPoint) -> None:
        """Give the cause of a walk that got stuck: its parent, or a contact that grazes and turns it within a step."""
        end = self.walk.end
        if self._ends_at_parent(before, last) or end is None:
            return

        def add(words: str) -> None:
            before = self.walk.end or end
            self.walk.finish(last, end.reason, f"{before.detail}; {words}", end.value)

        largest = abs(complex(last.orbit.multipliers[0]))
        if largest > _LARGE:
            add(f"the largest multiplier is {largest:.3g}")
        full, rigid = PERIOD * last.orbit.period, {switch for _, switch in last.orbit.system.structure.reactions}
        at_start = (each for each in last.orbit.events if min(each.theta, full - each.theta) < AT_START)
        if any(each.switch in rigid for each in at_start):
            advice = "the state jumps there: change the phases of all loads, so that the period starts elsewhere"
            add(f"an impact comes to the start of the period, and {advice}")
            return
        for each in last.orbit.margins if last.orbit.is_exact else []:
            if each.what == "reserve" and abs(each.value) <= _GRAZES * each.range:
                name = last.orbit.system.structure.contacts[each.contact].name
                advice = "beyond, it slips over a finite distance at once: begin a new walk there"
                add(f"the force of {name} reaches the one at which slip begins, and {advice}")
                return
        size = magnitude(last.orbit.extremes[:, :2], last.orbit.system)
        depths = [min(map(abs, turns.values), default=np.inf) for turns in last.orbit.turning_depths]
        if depths and min(depths) <= _GRAZES * size:
            contact = describe_switch(last.orbit, depths.index(min(depths)))
            self.walk.finish(last, EndReason.STEP, self._grazes(contact))
        elif words := coincidence(last.orbit):
            add(words)

    def _grazes(self, contact: str) -> str:
        """Return the details of the end of a walk that got stuck where a contact grazes."""
        detail = self.walk.end.detail if self.walk.end else ""
        advice = "the branch turns there too sharply to be followed: begin beyond it, or with a softer contact"
        return f"{detail}; {contact} grazes, and {advice}"


Report = Callable[[BranchPoint, list[SpecialPoint]], None]
"""Function called with each new point and the special points before it."""


@shows_progress(lambda count, point, special_points: f"{count} points, at {point.value:.6g}")
def follow(
    start: Orbit | SpecialPoint,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    report: Report | None = None,
    verify: bool = False,
    events: Sequence[Event] = (),
) -> Branch:
    """Follow a periodic orbit along one named parameter, around folds, and locate every special point.

    Parameters
    ----------
    start
        The orbit to start from, as from `find_orbit`; or a special point: from a flip the branch of twice the period is
        followed, from a branch point the crossing branch.
    parameter
        Name of the parameter, such as ``"frequency"`` or ``"stage2.clearance"``.
    to
        The value at which to stop; or two values, between which the branch is followed in both directions.
    walk
        Options of the walk.
    method
        Discretisation of the orbits: `Shooting` (the default) or `Balance`.
    report
        Called with each new point and the special points between it and the point before.
    verify
        True to verify the branch by independent checks before it is returned; see `gapwalk.verify`.
    events
        User-defined special points: functions of the orbit whose zeros are located; see `Event`.

    Returns
    -------
    Branch
        The branch: its points, its special points, and why it ends on either side.

    Raises
    ------
    ModelError
        For an unknown parameter, a range that does not contain the start, or a special point, such as a fold, at which
        no other branch begins.
    NumericalError
        If no branch that begins at this special point is found in the range.
    VerificationError
        If `verify` is True, and a check fails.
    Interrupted
        After Ctrl-C; the field `found` of the error is the branch so far.

    Notes
    -----
    Pseudo-arclength continuation: Keller (1977); Padmanabhan and Singh (1995), section 3. Step size: den Heijer and
    Rheinboldt (1981), SIAM Journal on Numerical Analysis 18, 925-948.

    Examples
    --------
    >>> import gapwalk as gw
    >>> mass = gw.System(
    ...     ["x"], mass=[1.0], damping=[0.1], stiffness=[1.0], harmonics=[gw.Harmonic(0.1, {"x": 1.0})], frequency=0.5
    ... )
    >>> branch = gw.follow(gw.find_orbit(mass), "frequency", 0.8)
    >>> round(branch.points[-1].value, 9)
    0.8
    """
    branch = _tracing(_beginnings(start, parameter, to, method), walk, events).to_end(join, report)
    if verify:
        from gapwalk.verification.verify_branch import confirm

        confirm(branch)
    return branch


def walk(
    start: Orbit | SpecialPoint,
    parameter: str,
    to: float | tuple[float, float],
    *,
    walk: WalkOptions | None = None,
    method: Method | None = None,
    events: Sequence[Event] = (),
    resume: WalkProgress | None = None,
) -> BranchWalk:
    """Walk a branch point by point, so that you can inspect each point, stop, and resume later.

    Parameters
    ----------
    start, parameter, to, walk, method, events
        As in `follow`.
    resume
        `BranchWalk.state` of a stopped walk from the same start; it can be pickled.

    Returns
    -------
    BranchWalk
        An iterator over the points; `BranchWalk.branch` is the branch so far.

    Raises
    ------
    ModelError
        As in `follow`.

    Examples
    --------
    >>> steps = gw.walk(orbit, "frequency", 1.6)
    >>> first = next(point for point in steps if point.measure("max.x") > 1.0)  # the first impact
    >>> round(first.value, 2), str(steps.special_points[0].kind)
    (0.71, 'grazing')
    """
    return BranchWalk(_beginnings(start, parameter, to, method), walk, events, resume)


WalkProgress = TracingState[Step]
"""Progress of the walk of a branch."""
BranchTracing = Tracing[BranchStart, BranchTracer, Step]
"""Tracing of a branch."""


class BranchWalk(Iterator[BranchPoint]):
    """Walk of a branch, as an iterator over its points; see `walk`."""

    def __init__(
        self,
        beginnings: list[BranchStart],
        options: WalkOptions | None = None,
        events: Sequence[Event] = (),
        resume: WalkProgress | None = None,
        *,
        judges: bool = True,
    ) -> None:
        self._tracing = _tracing(beginnings, options, events, resume, judges=judges)

    def __next__(self) -> BranchPoint:
        return next(self._tracing)[0]

    @property
    def special_points(self) -> tuple[SpecialPoint, ...]:
        """Special points between the last point and the one before it."""
        steps = self._tracing.steps
        return tuple(steps[-1][-1][1]) if steps and steps[-1] else ()

    @property
    def state(self) -> WalkProgress:
        """Progress so far: `walk` with it as `resume` continues as if it had never been stopped."""
        return self._tracing.state

    @property
    def branch(self) -> Branch:
        """Branch so far; raises a ModelError before the first point."""
        if not self._tracing.traces:
            raise ModelError("no point was computed yet; ask for a point first: next(steps)")
        return join(self._tracing)


def _beginnings(
    start: Orbit | SpecialPoint, parameter: str, to: float | tuple[float, float], method: Method | None
) -> list[BranchStart]:
    if not isinstance(start, Orbit | SpecialPoint):
        raise ModelError(
            f"follow starts from an orbit or a special point, not from {reprlib.repr(start)}; find an orbit first: "
            "gw.find_orbit(system)"
        )
    method = chosen(method or (start.orbit if isinstance(start, SpecialPoint) else start).own_method)
    if isinstance(start, SpecialPoint):
        value = start.orbit.system[parameter]
        within = to if isinstance(to, tuple) else (min(value, to), max(value, to))
        beginnings = switch(start, parameter, within, method)
        if not beginnings:
            raise NumericalError(f"no branch begins here from {within[0]:.6g} to {within[1]:.6g}; choose a wider range")
        return beginnings
    return [start_branch(start, parameter, to, way, method) for way in directions(start.system[parameter], to)]


def walk_out(beginnings: list[BranchStart], walk: WalkOptions | None = None) -> Branch:
    """Return the whole branch from one beginning, or from two at one point in opposite directions."""
    return _tracing(beginnings, walk).to_end(join)


def _tracing(
    beginnings: list[BranchStart],
    options: WalkOptions | None,
    events: Sequence[Event] = (),
    resume: WalkProgress | None = None,
    *,
    judges: bool = True,
) -> BranchTracing:
    check_events(events)

    def tracer(beginning: BranchStart, state: BranchTracerState | None) -> BranchTracer:
        return BranchTracer(beginning, options, state, events, judges=judges)

    return Tracing(beginnings, tracer, resume)


def join(tracing: BranchTracing) -> Branch:
    """Return the branch so far, with one direction of travel, from its traces in one direction or two."""
    tracers, walked = tracing.traces, tracing.steps
    equation, first = tracers[0].beginning.equation, tracers[-1].first
    ends = [_end(tracer, steps) for tracer, steps in zip(tracers, walked, strict=True)]
    if len(tracers) == 1:
        reason = EndReason.BRANCHED if tracers[0].beginning.singular else EndReason.START
        ends = [End(reason, first.value), *ends]
    points, special = in_one_direction(
        walked,
        first,
        _reversed,
        lambda each: replace(each, point=_reversed(each.point), before=each.after, after=each.before),
    )
    return Branch(equation.parameter or "", equation.period, *as_one(points, special), tuple(ends))


def _end(tracer: BranchTracer, steps: Sequence[Step]) -> End:
    """Return the end of one tracer."""
    # Ctrl-C may come while the special points before a new point of the walk are sought. The branch lacks that point.
    last = steps[-1][0] if steps else tracer.first
    is_whole = tracer.walk.point.arclength == last.arclength
    return tracer.end if tracer.end is not None and is_whole else End(EndReason.STOPPED, last.value)


def _reversed(point: BranchPoint) -> BranchPoint:
    return replace(point, tangent=-point.tangent, determinant=-point.determinant, arclength=-point.arclength, memo={})
