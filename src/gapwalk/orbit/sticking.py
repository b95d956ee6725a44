"""Friction that never slips over a whole period: what it keeps is no unknown of the orbit.

A Jenkins element that never slips keeps the position of its slider, ``s = e.q - z`` with the deflection ``e.q`` and the
extension z. Coulomb friction that never slips keeps the deflection itself. The motion is then one of a continuum, a
multiplier is exactly 1, and Newton's method has no unique solution. This is no branch point. Such a position has the
left eigenvector ``w = (e, 0, -1)`` or ``(e, 0, 0)`` of the monodromy matrix B, for every motion of the continuum.

Therefore the motion over one period is followed by a reset: ``z = e.q - s``, or ``e.q = s``, with the position s that
the start has. Its derivative N replaces the multiplier 1 of B by 0, as after slip, and leaves the others unchanged
(Wielandt's deflation). So the determinant of ``N B - 1`` does not change its sign where slip begins, and Newton's
method keeps s. It is rounded to a fine grid; otherwise rounding errors of s, which nothing would correct, would grow by
extrapolation from step to step of a walk.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.flow.dry_state import SlipEvent
from gapwalk.flow.flow import Arc
from gapwalk.model.coefficients import CoefficientLayout
from gapwalk.model.structure import Structure
from gapwalk.model.system import System
from gapwalk.orbit.floquet import multipliers

_KEPT = 1e-6  # change over one period, as a share, of what is kept but for rounding
_BITS = 30  # of the grid of positions that are kept: 1e-9 of a length of the system
_MOMENT = 1e-5  # radians of a phase at the start of an arc that an error of the state makes
_ROUNDING = 1e-12  # multipliers of motions with friction that are 0 but for rounding, over the largest
_DECAYED = 1e-2  # multipliers beyond which none counts as 0: beside a graze the largest may be 1e12


def collapses(system: System) -> bool:
    """Return True if friction or impacts can make neighbouring motions one, so that volumes of states vanish."""
    return bool(system.structure.memories or system.structure.reactions)


def stuck_in(layout: CoefficientLayout, coefficients: NDArray[np.float64], arcs: Sequence[Arc]) -> tuple[int, ...]:
    """Return the numbers of the contacts whose friction sticks all through some arcs, and keeps what it had.

    Friction of a stage that opens neither slips nor keeps anything meanwhile, so the transitions decide.
    """
    found = []
    for contact in never_slipping(arcs):
        kept = kept_row(layout, coefficients, contact)
        carried = kept
        for arc in reversed(arcs):
            carried = carried @ transition_of(arc)
        if np.abs(carried - kept).max() <= _KEPT * np.abs(kept).max():
            found.append(contact)
    return tuple(found)


def never_slipping(arcs: Sequence[Arc]) -> list[int]:
    """Return the numbers of the contacts whose friction sticks all through some arcs."""
    events = [event for arc in arcs for event in arc.slips]
    if not events:
        return []
    slipping = {event.contact for event in events if event.slip}
    return sorted({event.contact for event in events} - slipping)


def released(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    arcs: Sequence[Arc],
    start: NDArray[np.float64],
    length: float = 1.0,
) -> list[Arc]:
    """Return the arcs of one period with the reset of what friction keeps at the end of the last one.

    Shapes: `start` (state_size,).
    """
    stuck = stuck_in(layout, coefficients, arcs)
    if not stuck:
        return [*arcs]
    reset, offset = reset_of(layout, coefficients, stuck, start, length)
    last = arcs[-1]
    state, transition = reset @ last.state + offset, reset @ transition_of(last)
    return [*arcs[:-1], last._replace(state=state, transition=transition)]


def reset_of(
    layout: CoefficientLayout,
    coefficients: NDArray[np.float64],
    stuck: Sequence[int],
    start: NDArray[np.float64],
    length: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the reset of what some contacts keep: a matrix N, and the vector c of ``N y + c``."""
    structure, n = layout.structure, layout.structure.size
    reset, offset = np.eye(structure.state_size), np.zeros(structure.state_size)
    grid = 2.0 ** (round(math.log2(length)) - _BITS)
    vectors = {contact: coefficients[layout.contacts[contact].deflection] for contact in stuck}
    rigid = [vector for contact, vector in vectors.items() if contact not in structure.memories]
    if rigid:
        across = np.linalg.qr(np.transpose(rigid))[0]
        reset[:n, :n] -= across @ across.T
        offset[:n] = across @ (grid * np.round(start[:n] @ across / grid))
    for contact, vector in vectors.items():
        if contact in structure.memories:
            row = 2 * n + structure.memories.index(contact)
            reset[row] = 0.0
            reset[row, :n] = vector @ reset[:n, :n]
            kept = float(vector @ start[:n] - start[row])
            offset[row] = vector @ offset[:n] - grid * round(kept / grid)
    return reset, offset


def kept_row(layout: CoefficientLayout, coefficients: NDArray[np.float64], contact: int) -> NDArray[np.float64]:
    """Return the derivative by the state of what friction keeps while it sticks; shape (state_size,)."""
    structure = layout.structure
    row = np.zeros(structure.state_size)
    row[: structure.size] = coefficients[layout.contacts[contact].deflection]
    if contact in structure.memories:
        row[2 * structure.size + structure.memories.index(contact)] = -1.0
    return row


class Closure(NamedTuple):
    """Multipliers of a motion with dry friction over one period."""

    #: shape (state_size,): They are exactly 1 for what friction keeps, and exactly 0 where slip or stick makes
    #: neighbouring motions one.
    multipliers: NDArray[np.complex128]
    slips: tuple[SlipEvent, ...] = ()  #: The log of slip: a mode that only goes on at the start of an arc is left out.
    stuck: tuple[int, ...] = ()  #: Numbers of the contacts whose friction never slips.

    @classmethod
    def of(
        cls,
        layout: CoefficientLayout,
        coefficients: Callable[[], NDArray[np.float64]],
        arcs: Sequence[Arc],
        start: NDArray[np.float64],
    ) -> Closure:
        """Compute the multipliers from the arcs of one period; `coefficients` is called only if friction sticks."""
        if not any(arc.slips for arc in arcs):
            return cls(multipliers([transition_of(arc) for arc in arcs]))
        stuck = stuck_in(layout, coefficients(), arcs) if never_slipping(arcs) else ()
        free = released(layout, coefficients(), arcs, start) if stuck else arcs
        found = multipliers([transition_of(arc) for arc in free])  # the largest first
        sizes = [abs(each) for each in found.tolist()]
        least = min(_ROUNDING * max(1.0, sizes[0]), _DECAYED)
        if sizes[-1] <= least:
            found[[size <= least for size in sizes]] = 0.0
        if stuck:
            values = [*found.tolist()[: len(found) - len(stuck)], *[1.0 + 0.0j] * len(stuck)]
            found = np.array(sorted(values, key=abs, reverse=True))
        return cls(found, _joined(arcs), stuck)


def _joined(arcs: Sequence[Arc]) -> tuple[SlipEvent, ...]:
    """Return the log of slip of successive arcs as one.

    The state at the start of an arc is off by what Newton's method leaves. If friction slips there, its force may be a
    little within its bound; then it would stick for a moment. Such a moment is left out.
    """
    modes, found = {event.contact: event.slip for event in arcs[-1].slips}, list[SlipEvent]()
    for arc in arcs:
        for place, event in enumerate(arc.slips):
            before, is_start = modes[event.contact], event.theta == arc.slips[0].theta
            if is_start and _lasts_a_moment(arc.slips[place:], before):
                event = event._replace(slip=before)
            if event.slip != before or (is_start and arc is arcs[0]):
                found.append(event)
                modes[event.contact] = event.slip
    return tuple(found)


def _lasts_a_moment(events: Sequence[SlipEvent], before: int) -> bool:
    """Return True if friction returns to the mode before an arc a moment after the start, the first of the events."""
    following = (each for each in events[1:] if each.contact == events[0].contact)
    later = next(following, events[0])
    return later.slip == before and later.theta - events[0].theta < _MOMENT


def transition_of(arc: Arc) -> NDArray[np.float64]:
    """Return the transition of an arc that was integrated with it."""
    assert arc.transition is not None
    return arc.transition


def without_kept(multipliers: NDArray[np.complex128], count: int) -> NDArray[np.complex128]:
    """Return multipliers with 0 in place of `count` that are 1, as in `Closure`."""
    if not count:
        return multipliers
    order = np.argsort(np.abs(multipliers - 1.0), kind="stable")
    return np.append(np.delete(multipliers, order[:count]), np.zeros(count, complex))


def kept_words(structure: Structure, stuck: Iterable[int]) -> list[str]:
    """Return a clause for each contact that never slips: what it keeps."""
    return [
        f"{structure.contacts[contact].name} never slips: its "
        f"{'extension' if contact in structure.memories else 'position'} is kept"
        for contact in stuck
    ]
