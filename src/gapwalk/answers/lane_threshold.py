"""Search for a threshold by equal steps, where no two neighbouring values have the same sequence of contacts.

There is no border that could be followed. Slow sweeps at a value at which something rattles say where it does. There
and between these places the value is raised until nothing rattles, beginning with the motion that did, and ever nearer
to the place where rattle lasts longest. At the end the whole range is tried, from random starts and by sweeps.

Method: docs/howto/studies.md
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from gapwalk.answers.gap_states import Direction, labels_along, lane_states
from gapwalk.answers.lane_sweep import LanePiece, Piece, joined, random_states, stages, sweep_piece
from gapwalk.answers.threshold import (
    Confirmation,
    Each,
    Hit,
    Request,
    Round,
    Threshold,
    ThresholdSearch,
    Tried,
    points_of,
)
from gapwalk.attractors.lane_settling import LANE_ERROR, LaneMotion, Start, settle_lanes
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lane_code import WIDTH

_NARROW = 2e-4  # width of the limit, relative to the range
_FIRST, _GROWS = 16.0, 4.0  # steps in which a value is raised first, as multiples of that; factor from one to the next
_STEPS = 320  # steps of the sweeps
_FINEST = 1.5e-5  # distance of places, as a share of their range, between which no other is tried
_BAND = 4.0 / _STEPS  # share of their range about the last motion that rattles, in which most random starts are


def swept(asked: Request, value: float, piece: Piece) -> Tried:
    """Sweep on slowly, as `gapwalk.answers.lane_sweep.sweep_piece` does."""
    found = sweep_piece(asked.at(value, asked.span[0]), asked.over, asked.span, _STEPS, piece)
    names, motions = [form.name for form in asked.system.structure.equations.contacts], list[Hit]()
    new = (motion for part in found.parts for motion in part.motions[piece.before is not None :])
    for motion in (motion for motion in new if not motion.diverged):
        labels = zip(asked.gaps, lane_states(motion, names, asked.gaps), strict=True)
        motions.append(Hit(value, motion.value, motion.state, tuple(gap for gap, label in labels if label.rattles)))
    return Tried(tuple(motions), swept=found)


def rattling_along(asked: Request, value: float, each: Each) -> Generator[Any, None, list[Hit]]:
    """Sweep slowly up and down, and return the motions that rattle."""
    pieces, hits, system = dict[int, LanePiece](), list[Hit](), asked.at(value, asked.span[0])
    for some in stages(_STEPS, pieces):
        tried = yield from each(partial(swept, asked, value), list(some.values()))
        pieces |= {number: part.swept for number, part in zip(some, tried, strict=True) if part.swept is not None}
    about = system, asked.over, asked.span, _STEPS
    for sweep in (joined(*about, way, list(pieces.values()), (), whole=False) for way in Direction):
        known = [labels_along(sweep.lanes, sweep.contacts, gap) for gap in asked.gaps]
        for motion, labels in zip(sweep.lanes, zip(*known, strict=True), strict=True):
            gaps = tuple(gap for gap, each in zip(asked.gaps, labels, strict=True) if each.state.rattles)
            if gaps:
                hits.append(Hit(value, motion.value, motion.state, gaps))
    return hits


def raised(asked: Request, step: float, is_wide: bool, piece: Sequence[Hit]) -> Tried:
    """Raise the value at some places in steps until nothing rattles.

    Each place begins with a motion that rattles there or beside it, and ends with that from rest while steps are wide.
    What one place reaches, the others need not try.
    """
    names, rest = [form.name for form in asked.system.structure.equations.contacts], state_at_rest(asked.system)
    best, tried, seeds = piece[0].value, list[Hit](), list(piece)
    ends, steps, rested = [asked.to[1]] * len(seeds), [1.0] * len(seeds), [not is_wide] * len(seeds)

    def ahead(k: int) -> Start | None:
        if (ends[k] - best) / step <= 1.0:
            if rested[k] or (asked.to[1] - best) / step <= 1.0:
                return None
            rested[k], ends[k], steps[k], seeds[k] = True, asked.to[1], 1.0, seeds[k]._replace(state=rest)
        value = best + min(steps[k], 0.5 * (ends[k] - best) / step) * step
        return Start(k, value, asked.at(value, seeds[k].other), seeds[k].state)

    def judge(start: Start, motion: LaneMotion) -> Start | None:
        nonlocal best
        k, labels = start.key, [] if motion.diverged else lane_states(motion, names, asked.gaps)
        gaps = tuple(gap for gap, label in zip(asked.gaps, labels, strict=False) if label.rattles)
        tried.append(seeds[k]._replace(value=start.value, state=motion.state, gaps=gaps))
        if gaps:
            seeds[k], steps[k], rested[k] = tried[-1], _GROWS * steps[k], not is_wide
            best = max(best, start.value, key=lambda value: asked.way * value)
        else:
            ends[k] = start.value
        return ahead(k)

    firsts = [start for k in range(len(seeds)) if (start := ahead(k)) is not None]
    for _ in settle_lanes(firsts, judge, slowest=[start.system for start in firsts], gaps=asked.gaps):
        pass
    return Tried(tuple(tried))


class LaneThresholdSearch(ThresholdSearch):
    """Search for a threshold by equal steps: first everywhere, then where it rattles and everywhere in turn."""

    usual = 3, 28

    @property
    def is_over(self) -> bool:
        """True if no further round would change the threshold."""
        last = self.rounds[-1] if self.rounds else None
        return last is not None and (math.isnan(last.quiet) or (last.confirms and last.hit is None))

    def advance(self, each: Each) -> Generator[Any]:
        """Raise the value from what rattles farthest until nothing does, or try it in the whole range."""
        self.rounds.append((yield from self._raise(each) if len(self.rounds) % 2 else self._try(each)))

    def _raise(self, each: Each) -> Generator[Any, None, Round]:
        asked, tried, known = self.request, list[Hit](), {each.other: each for each in self.rounds[-1].band}
        stride = -(-len(known) // WIDTH)  # of many places only some begin
        band = tuple(known[other] for other in sorted(known)[::stride])
        narrow, near, wide = _NARROW * (asked.to[1] - asked.to[0]), stride / _STEPS, _FIRST
        while near > _FINEST:
            seeds, finer = self._between(band, near)
            pieces = [seeds[first : first + WIDTH] for first in range(0, len(seeds), WIDTH)]
            parts = yield from each(partial(raised, asked, wide * narrow, wide > 1.0), pieces)
            new = [motion for part in parts for motion in part.motions]
            before, band = band[0].value, self._farthest([*band, *(motion for motion in new if motion.gaps)])
            near = finer if wide > 1.0 or band[0].value == before else near
            wide = max(wide / _GROWS, 1.0)
            tried += new
        quiet = asked.way * min(asked.way * (band[0].value + narrow), asked.way * asked.to[1])
        counts = Confirmation(quiet, len(tried), 1, sum(bool(motion.gaps) for motion in tried), 0, 0, 0, 0, LANE_ERROR)
        return Round(counts, band[0], (), (), quiet, False, band, points_of(tried))

    def _try(self, each: Each) -> Generator[Any, None, Round]:
        asked, hit, rest = self.request, self._hit, state_at_rest(self.request.system)
        low, high = asked.span
        places, values = np.linspace(low, high, asked.options.values), asked.coarse.tolist()
        if hit is not None:
            near = np.clip(hit.other + (high - low) * np.linspace(-_BAND, _BAND, len(places) // 2), low, high)
            places, values = np.unique([*places[::3], *near, hit.other]), [self.rounds[-1].quiet]
        few, pairs, states = (max(asked.options.starts - 2, 1), asked.options.seed), list[tuple[float, float]](), []
        for other, value in product(places.tolist(), values):  # those with about the same steps side by side
            more = [] if hit is None else [hit.state, *random_states(asked.at(value, other), rest, *few, other)]
            own = [rest, *more]
            pairs += [(other, value)] * len(own)
            states += own
        found, tried = yield from self._judged(each, np.array(pairs), np.array(states))
        hits = [motion for motion in tried if motion.gaps]
        last = self._farthest(hits)
        if not last or (hit is None and last[0].value != asked.to[1]):
            hits += yield from rattling_along(asked, last[0].value if last else values[0], each)
        band, notes = self._farthest(hits), ()
        beyond = [value for value in values if not band or asked.way * (value - band[0].value) > 0.0]
        quiet = beyond[0] if beyond else asked.to[1]
        if not band and hit is None:
            notes, quiet = ("nothing rattles in the whole range",), math.nan
        elif band and band[0].value == asked.to[1]:
            notes, quiet = (self._widen(band[0]),), math.nan
        starts, lost = len(states) // (len(places) * len(values)), len(states) - len(tried)
        counts = len(states), starts, len(hits), 0, lost, found.waited, 0
        counted, points = Confirmation(values[-1], *counts, found.error), points_of([*tried, *hits])
        return Round(counted, band[0] if band else None, (), notes, quiet, hit is not None, band, points)

    def _farthest(self, hits: Sequence[Hit]) -> tuple[Hit, ...]:
        """Return those of the value that lies farthest towards the quiet side."""
        farthest = max((self.request.way * each.value for each in hits), default=0.0)
        return tuple(each for each in hits if self.request.way * each.value == farthest)

    def _between(self, band: Sequence[Hit], near: float) -> tuple[list[Hit], float]:
        """Return places at and between some motions that rattle, and their distances, as those given, as a share."""
        low, high = self.request.span
        found = {round((each.other - low) / (high - low), 12): each for each in band}
        while True:
            near *= 0.5
            finer = {round(share + side * near, 12): each for side in (-1, 1) for share, each in found.items()}
            found = {share: each for share, each in (finer | found).items() if 0.0 <= share <= 1.0}
            if len(found) >= WIDTH - 1:
                return [each._replace(other=low + share * (high - low)) for share, each in sorted(found.items())], near

    def found(self) -> Threshold:
        """Return the threshold after the rounds that are done."""
        asked, found, hit, last = self.request, super().found(), self._hit, self.rounds[-1]
        found = replace(found, confirmation=last.tried if last.confirms else None)
        if hit is None or math.isnan(last.quiet):
            return found
        unit = asked.system.units.parameter(asked.over) if asked.system.units else ""
        step = f"{abs(asked.span[1] - asked.span[0]) / _STEPS:.3g} {unit}".rstrip()
        note = (
            f"all motions were simulated by equal time steps, at {asked.options.values} values of {asked.over}, "
            f"and at the limit along it, up and down in steps of {step}: a narrower band may lie between two"
        )
        between, error = (hit.value, last.quiet), abs(last.quiet - hit.value)
        return replace(found, between=between, at=hit.other, uncertainty=error, notes=(*found.notes, note))
