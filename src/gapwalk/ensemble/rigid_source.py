"""Lines of a kernel for a rigid stop: impacts within a step, and contacts that are held.

The crossing of the clearance is the zero of the cubic through the deflections and rates at both ends of the step. An
impulse there changes the state at the end by the exact propagation of the linear part over the rest of the step. If the
deflection falls back within that rest, the contact is held: at the end of the step, a reaction has brought the
deflection to the clearance and its rate to zero. It is released where the motion without a reaction leads away.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from gapwalk.ensemble.source_text import FUNCTIONS, Sheet, Term, clipped, either, greatest

_TINY = 1e-300  # keeps the inverse of a vanishing change finite
_ITERATIONS = 3  # of Newton's method, from the zero of a parabola


class Impact(NamedTuple):
    """Impact and hold of a stop in a step, in terms, each times the side of the stop: +1 or -1."""

    impulse: Any  #: Change of the rate of the deflection by the impact; 0 if there is none.
    rest: Any  #: Part of the step after the impact.
    #: depth, rate: Deflection past the clearance, and rate, which a reaction removes at the end of the step; 0 if it is
    #: not held.
    depth: Any
    rate: Any
    held: Any  #: 1 or -1 if it is held from now on, otherwise 0.


class RigidSource:
    """Writer of the lines for one rigid stop."""

    def __init__(self, sheet: Sheet, clearances: Mapping[int, Any], span: Term) -> None:
        self._sheet, self._clearances, self._span = sheet, clearances, span

    def impact(
        self,
        start: tuple[Term, Term],
        end: tuple[Term, Term],
        held: Term,
        rebound: Callable[[Any], Any],
        echo: Callable[[int, Any], Any],
    ) -> Impact:
        """Write the lines for a step."""
        sheet, span = self._sheet, self._span
        side, clearance = self._side(end[0])
        (before, rate), (after, last) = ((_turned(x, side) - clearance, _turned(v, side)) for x, v in (start, end))
        at, speed, top = self._crossing(before, rate, after, last)
        rest = 1.0 - at
        speed = speed / span
        through = sheet.write("({} > 0.0) | ({} > 0.0)", after, top)
        echoes = [echo(which, rest) for which in (0, 1)]
        change = speed - _turned(rebound(_turned(speed, side)), side)
        falls_back = sheet.write("{} - {} * {} > 0.0", after, change, echoes[0])
        meets = sheet.write("{} & ({} == 0.0)", through, held)
        impulse = either(meets, either(falls_back, speed, change), 0.0)
        depth, rate = after - impulse * echoes[0], last - impulse * echoes[1]
        holds = sheet.write("{} > 0.0", depth)
        found = impulse, either(holds, depth, 0.0), either(holds, rate, 0.0), either(holds, 1.0, 0.0)
        impulse, depth, rate, holds = (_turned(each, side) for each in found)
        return Impact(impulse, rest, depth, rate, holds)

    def again(self, end: tuple[Term, Term], removed: tuple[Term, Term], held: Term, struck: Term) -> tuple[Any, ...]:
        """Write what a reaction removes in all, after those of other stops, what of that is new, and if it is held.

        A reaction that would pull is left out: Gauss and Seidel's method, projected. Where another stop was `struck`
        and is not held, the contact is no longer held: it may meet its stop again in the next step.
        """
        sheet, (_, clearance) = self._sheet, self._side(held)
        depth = removed[0] + (end[0] - held * clearance)
        holds, struck = sheet.write("{} * {} > 0.0", depth, held), sheet.write("{} > 0.0", struck)
        depth = either(struck, removed[0], either(holds, depth, 0.0))
        rate = either(struck, removed[1], either(holds, removed[1] + end[1], 0.0))
        free = either(struck, 0.0, either(holds, held, 0.0))
        return depth, rate, depth - removed[0], rate - removed[1], free

    def _side(self, value: Term) -> tuple[Any, Any]:
        """Write the side that a value tells, and the clearance there."""
        sides = [*self._clearances]
        if not sides[1:]:
            return sides[0], self._clearances[sides[0]]
        up, down = self._clearances[1], self._clearances[-1]
        return self._sheet.write("np.copysign(1.0, {})", value), either(self._sheet.write("{} > 0.0", value), up, down)

    def _crossing(self, before: Term, rate: Term, after: Term, last: Term) -> tuple[Term, Term, Term]:
        """Write the place of the zero of a cubic in the step, its slope there over a step, and its value at a turn."""
        sheet, span = self._sheet, self._span
        slope, bend = span * rate, span * (last - rate)
        curve, excess = (after - before) - slope, (after - before) - span * 0.5 * (rate + last)
        root = FUNCTIONS["sqrt"](greatest(slope * slope - 4.0 * (curve * before), 0.0))
        at = either(
            sheet.write("{} > 0.0", slope),
            before * -2.0 / (slope + root),
            (root - slope) / (curve * 2.0 + _TINY),
        )

        def value(at: Any) -> Any:
            return before + slope * at + bend * 0.5 * (at * at) + excess * (at * at) * (3.0 - 2.0 * at)

        def tangent(at: Any) -> Any:
            return slope + bend * at + excess * 6.0 * (at * (1.0 - at))

        at = clipped(at)
        for _ in range(_ITERATIONS):
            at = clipped(at - either(sheet.write("{} > 0.0", tangent(at)), value(at) / tangent(at), 0.0))
        turns = sheet.write("({} > 0.0) & ({} < 0.0)", rate, last)  # it may reach the clearance between two steps
        return at, greatest(tangent(at), 0.0), either(turns, value(rate / (rate - last)), -1.0)


def polynomial(names: Sequence[Term], at: Any) -> Any:
    """Write a polynomial with some coefficients, of ascending powers."""
    total: Any = names[-1]
    for name in reversed(names[:-1]):
        total = name + total * at
    return total


def _turned(value: Term, side: Any) -> Any:
    """Multiply by a side."""
    if isinstance(side, Term):
        return side * value
    return value if side > 0 else -value
