"""States of a gap in one motion: closed, open, or rattling on one side or on both; and systems whose gaps keep one.

A gap is a contact with a clearance. It is quiet where it never opens and where it never touches; it rattles where it
does both by turns. Only the innermost stage of each side counts: further stages stiffen a contact that is closed.
Many motions are judged by the batch integrator once they have settled.

A motion in which a gap is quiet is also a motion of the system whose gap keeps that state for ever: its force on that
side goes on beyond the breakpoint as the same formula, as if the parts were glued, or it is always zero. That system
is smooth where the gap would rattle, so that its response shows how far a design is from a quiet gap.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.attractors.many_motions import ContactFigures, ManyMotions, enough, motions_of
from gapwalk.attractors.regime_judge import Waited, wait
from gapwalk.attractors.section import Strobe
from gapwalk.errors import ModelError
from gapwalk.flow.forces import contact_deflections
from gapwalk.flow.motion import Motion
from gapwalk.model.coefficients import coefficients_of, layout_of
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.laws import Law, Stages
from gapwalk.model.problems import did_you_mean
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit

WATCHED = 16
"""Forcing periods over which the gaps of many motions are observed; a multiple of most periods."""
_TRANSIENT = 16  # forcing periods after which fewer steps may do: random starts close gaps at great velocities
_LONGEST = 8  # longest period that is distinguished from motions without period
_RESTS = 1e-9  # share of a clearance by which a deflection that rests on the breakpoint may miss it


class GapState(StrEnum):
    """State of a gap over a whole motion.

    Examples
    --------
    >>> [state.value for state in gw.records.GapState][:3]
    ['closed', 'open', 'one side']
    """

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
    """Return the gaps in which parts may rattle: all gaps, or, in a drive train, those of links that can part.

    A link with a spring that acts always, such as a clutch damper with stages, cannot part.
    """
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
    """Return the states of a gap in many motions, as codes (`GapState.code`).

    Shapes: `impacts` (count, 2); `is_closed` (count,), bool.
    """
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


def judge_gaps(
    system: System,
    states: NDArray[np.float64],
    values: Mapping[str, NDArray[np.float64]] | None,
    gaps: Sequence[str],
    patience: int,
) -> GapVerdicts:
    """Follow motions until they are periodic or patience ends, and return what their gaps do then.

    Shapes: `states` (count, state_size).
    """
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
        raise ModelError(f"{gap} is a rigid stop, which stays closed by no force of its own; its gap may stay open")
    contacts = (*structure.contacts[:place], replace(form, law=_Kept(form.law, side)), *structure.contacts[place + 1 :])
    return System.from_values(replace(structure, contacts=contacts), system.values)


def _width(system: System, gap: str) -> float:
    """Return the width of a gap between its sides; infinite if the contact acts on one side only."""
    clearances = [system.breakpoints[switch][2] for switch in innermost(system, gap)]
    return sum(clearances) if len(clearances) == 2 else np.inf
