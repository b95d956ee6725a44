"""Slow sweeps of systems with many gaps by equal steps: what all gaps do at each step, up and down.

Where several gaps rattle, no two neighbouring values have the same sequence of contacts: the answer is not a curve with
a hundred grazing points, but a band of motions that settle at each value. Four parts of the range are computed side by
side, in both directions. Each step begins with the motion of the step before, and each part at rest; the sweep of the
part before continues into it until both have the same motion. Further values between two steps narrow down the ends of
bands. Motions that no sweep meets are sought from random starts of physical size, and followed both ways.

Method: docs/numerics/notes/ensembles.md
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gapwalk.answers.gap_states import (
    OTHER,
    BandEnd,
    Direction,
    SettledSweep,
    SweepEnd,
    innermost,
    labels_along,
    usual_gaps,
)
from gapwalk.answers.held_flank import grazing_near, unpolished
from gapwalk.attractors.lane_settling import (
    LONG,
    TIMES,
    LaneMotion,
    Start,
    settle_lanes,
    settled_again,
    slow_modes,
    slow_places,
)
from gapwalk.bifurcation.isolated.search_starts import generator, spread_starts, state_box
from gapwalk.ensemble.batch_flow import state_at_rest
from gapwalk.ensemble.lane_code import WIDTH
from gapwalk.ensemble.lanes import prefers_lanes
from gapwalk.errors import ModelError, NumericalError
from gapwalk.model.coefficients import ParameterLine
from gapwalk.model.drivetrain.train_assembly import TrainAssembly
from gapwalk.model.system import System

_NARROW = 5e-5  # width to which the ends of bands are narrowed down, as a share of the range
_ROUGH = 0.13  # the same beside chaos, as a share of a step: its life there is the longer, the nearer it is to its end
_PART = 10  # steps of a part, at most
_STEPS = 5  # steps of each part in one piece of work, at least
_AT_ONCE = WIDTH // 2  # parts in a register, each in both directions
_BETWEEN = WIDTH - 1  # values between two steps
_SAMPLE = 2 * WIDTH  # periodic motions that are settled again by half the step
_FINER_ENDS = 3.0  # factor on the steps there: with half of that an end is .1 rpm off, without it a band too many
_NARROWED, _BESIDE = 0.15, 0.05  # shares of a step: width from which an end is located, how far it may be beside it
_TOUCHES, _ONCE = 3, 1e-6  # touches of a gap that are tried; how far others may be, of the largest depth
_FEW = 4  # changes of a gap, from either end of a sweep, that are narrowed down
_FLIES, _SWINGS = 0.02, (0.02, 0.1)  # rates of random starts, of the speed: of loose parts, and behind a spring
_APART = 40  # random starts are at every fortieth of the range


def is_many(system: System) -> bool:
    """Return True if the gaps of a system interact so often that its sweeps are made by equal steps."""
    return prefers_lanes(system) and len(usual_gaps(system)) > 1


@dataclass(frozen=True, eq=False)
class LanePiece:
    """Parts of sweeps in both directions: by part, then rising and falling."""

    parts: tuple[LanePart, ...]


@dataclass(frozen=True, eq=False)
class LanePart:
    """Settled motions at successive steps of a part of a sweep, from the last one of the piece before on."""

    number: int  #: Number of the part, from low to high.
    direction: Direction  #: Direction of the sweep.
    motions: tuple[LaneMotion, ...]  #: The motions, in the order of the sweep.


def bounds_of(steps: int) -> list[tuple[int, int]]:
    """Return the first and the last step of each part of a sweep, from low to high."""
    count = -(-steps // _PART)
    edges = np.round(np.linspace(0, steps, count + 1)).astype(int).tolist()
    return list(pairwise(edges))


class Piece(NamedTuple):
    """Some steps of a few successive parts in both directions, which follow those of the piece before."""

    parts: tuple[int, ...]
    before: LanePiece | None


def stages_of(steps: int) -> int:
    """Return in how many pieces, one after the other, each register goes through its parts: their edges are first."""
    return 1 + -(-max(high - low for low, high in bounds_of(steps)) // _STEPS)


def pieces_of(steps: int, stage: int, known: Mapping[int, LanePiece]) -> dict[int, Piece]:
    """Return the pieces of one stage by their numbers; those of the stage before are known."""
    parts = range(len(bounds_of(steps)))
    groups = [tuple(parts[first : first + _AT_ONCE]) for first in parts[::_AT_ONCE]]
    first = stage * len(groups)
    return {
        first + number: Piece(group, known[first + number - len(groups)] if stage else None)
        for number, group in enumerate(groups)
    }


def stages(steps: int, known: Mapping[int, LanePiece]) -> Iterator[dict[int, Piece]]:
    """Yield the pieces of each stage; those of one are known before those of the next are asked for."""
    for stage in range(stages_of(steps)):
        yield pieces_of(steps, stage, known)


def sweep_piece(system: System, parameter: str, within: tuple[float, float], steps: int, piece: Piece) -> LanePiece:
    """Sweep on, from the motions of the piece before, or from those that rest leads to at the edges of the parts."""
    values, bounds = np.linspace(*within, steps + 1).tolist(), bounds_of(steps)
    line, systems = ParameterLine(system, parameter), dict[int, System]()

    def at(place: int) -> System:
        if place not in systems:
            systems[place] = line.system_at(values[place])
        return systems[place]

    edges = sorted({place for part in piece.parts for place in bounds[part]})
    ends = [at(place) for place in (edges[0], edges[-1])]
    if piece.before is None:
        rests = [Start(place, values[place], at(place), state_at_rest(at(place))) for place in edges]
        begun = {start.key: motion for start, motion in settle_lanes(rests, slowest=ends)}
        ways = product(piece.parts, Direction)
        return LanePiece(tuple(LanePart(k, way, (begun[bounds[k][way is Direction.DOWN]],)) for k, way in ways))
    known = {(part.number, part.direction): list(part.motions) for part in piece.before.parts}
    found, slow = {key: [motions[-1]] for key, motions in known.items()}, slow_places(system)

    def ahead(part: int, way: Direction) -> Start | None:
        own, motion = [*known[part, way][:-1], *found[part, way]], found[part, way][-1]
        place = round((motion.value - values[0]) / (values[-1] - values[0]) * steps) + way.sign
        if motion.diverged or not bounds[part][0] <= place <= bounds[part][1]:
            return None
        state = motion.state
        if len(own) > 1 and motion.period == own[-2].period == 1:  # along a curve the slow part is a straight line
            state = state.copy()
            state[slow] += state[slow] - own[-2].state[slow]
        return Start((part, way), values[place], at(place), state, is_warm=True)

    def step(start: Start, motion: LaneMotion) -> Start | None:
        found[start.key].append(motion)
        return ahead(*start.key)

    # a lane that is ahead goes on until the slowest has made its steps: an idle one costs as much
    firsts = [ahead(*way) for way in known]
    for _ in settle_lanes([each for each in firsts if each], step, slowest=ends):
        if all(len(found[way]) > _STEPS or ahead(*way) is None for way in known):
            break
    return LanePiece(tuple(LanePart(part, way, tuple(motions)) for (part, way), motions in found.items()))


def joined(
    system: System,
    parameter: str,
    within: tuple[float, float],
    steps: int,
    direction: Direction,
    pieces: Sequence[LanePiece],
    gaps: Sequence[str],
    *,
    whole: bool = True,
    other: SettledSweep | None = None,
) -> SettledSweep:
    """Join the parts of a sweep, and narrow down the ends of its bands; with ``whole=False`` show what is known.

    What the sweep in the `other` direction found in chaos needs no second long watch, and an end that both have is only
    tried on either side.
    """
    parts: dict[int, list[LaneMotion]] = {}
    for part in (part for piece in pieces for part in piece.parts if part.direction is direction):
        known = parts.setdefault(part.number, [])
        known += part.motions[bool(known) :]
    order = [number for number in range(len(bounds_of(steps)))[:: direction.sign] if number in parts]
    motions: list[LaneMotion] = []
    for number in order:
        own = parts[number]
        if motions and whole and motions[-1].value == own[0].value and not motions[-1].is_like(own[0]):
            own = _taken_over(system, parameter, motions[-1], own)
        motions += own[1:] if motions and motions[-1].value == own[0].value else own
    sweep = SettledSweep(parameter, within, direction, (), (), lanes=tuple(motions), contacts=tuple(_names(system)))
    if not whole:
        return sweep
    return _narrowed(system, sweep, gaps, other)


def _names(system: System) -> list[str]:
    return [form.name for form in system.structure.equations.contacts]


def _taken_over(system: System, parameter: str, before: LaneMotion, own: list[LaneMotion]) -> list[LaneMotion]:
    """Go on with a sweep through a part that began with another motion, until both are the same."""
    found, line = [before], ParameterLine(system, parameter)

    def ahead(place: int, motion: LaneMotion) -> Start:
        return Start((place,), own[place].value, line.system_at(own[place].value), motion.state, (own[place],))

    def step(start: Start, motion: LaneMotion) -> Start | None:
        (place,) = start.key
        found.append(motion)
        if place + 1 >= len(own) or motion.diverged or motion.is_like(own[place]):
            return None
        return ahead(place + 1, motion)

    for _ in settle_lanes([ahead(1, before)], step):
        pass
    return [*found, *own[len(found) :]]


def _narrowed(
    system: System, sweep: SettledSweep, gaps: Sequence[str], other: SettledSweep | None = None
) -> SettledSweep:
    """Add motions between two steps where a gap begins or ceases to rattle, until its ends are narrow."""
    line, sign = ParameterLine(system, sweep.parameter), sweep.direction.sign
    edges, least = [motion.value for motion in sweep.lanes], _NARROW * (sweep.within[1] - sweep.within[0])
    lanes, places = (other.lanes, _ends(other.lanes, edges[::-1], other, gaps)) if other else ((), {})
    watched = {motion.value: (motion,) for motion in lanes if not motion.period and motion.watched >= LONG}
    beside = {lanes[k + side].value for k in places for side in (0, 1)}  # of each end that the other sweep has found
    sweep = sweep if other else _sampled(line, sweep)
    sweep, step = _watched_on(line, sweep, gaps, watched), abs(edges[-1] - edges[0]) / max(len(edges) - 1, 1)
    ends = _Touches(line, other)
    while True:
        motions, starts = list(sweep.lanes), list[Start]()
        for place, changing in _ends(motions, edges, sweep, gaps).items():
            one, two = motions[place : place + 2]
            is_chaotic, width = not (one.period and two.period), abs(two.value - one.value)
            if width <= _NARROWED * step and all(ends.locate(gap, one, two, _BESIDE * step) for gap in changing):
                continue
            inside = inside_of(one.value, two.value, max(least, _ROUGH * step * is_chaotic))
            tried = [each for each in beside if min(one.value, two.value) < each < max(one.value, two.value)]
            starts += [
                Start((), value, line.system_at(value), one.state, watched.get(value, ()), is_chaotic, LONG)
                for value in (inside and tried) or inside
            ]
        if not starts:
            return replace(sweep, ends=ends.found)
        systems = [start.system for start in starts]
        settled = settle_lanes(starts, finer=_FINER_ENDS, slowest=systems)
        motions += [motion for _, motion in settled]
        sweep = replace(sweep, lanes=tuple(sorted(motions, key=lambda motion: sign * motion.value)))


class _Touches:
    """Exact ends of the bands of a sweep: where a gap of a periodic motion begins or ceases to part by a touch."""

    def __init__(self, line: ParameterLine, other: SettledSweep | None) -> None:
        self.line = line
        known = {motion.value: motion for motion in other.lanes} if other else {}
        self._others = [(each, known[each.before], known[each.after]) for each in other.ends] if other else []
        self._tried = dict[tuple[str, float, float], BandEnd | None]()

    @property
    def found(self) -> tuple[SweepEnd, ...]:
        """All that were located."""
        return tuple(SweepEnd(*key, end) for key, end in self._tried.items() if end is not None)

    def locate(self, gap: str, one: LaneMotion, two: LaneMotion, near: float) -> bool:
        """Return True if the end of a gap between two motions is located, at most `near` beyond them."""
        key = gap, one.value, two.value
        if key not in self._tried:
            alike = (
                each.end
                for each, before, after in self._others
                if (each.gap, each.after, each.before) == key and before.is_like(two) and after.is_like(one)
            )
            end = next(alike, None) or next(filter(None, (self._touch(gap, each) for each in (two, one))), None)
            low, high = min(key[1:]) - near, max(key[1:]) + near
            self._tried[key] = end if end is not None and low <= end.value <= high else None
        return self._tried[key] is not None

    def _touch(self, gap: str, motion: LaneMotion) -> BandEnd | None:
        """Return the touch of a gap near a motion, with what moves it; None without a period, or if none is found."""
        if not motion.period:
            return None
        try:
            orbit = unpolished(self.line.system_at(motion.value), motion.period, motion.state)
            turns = {switch: orbit.turning_depths[switch] for switch in innermost(orbit.system, gap)}
            sizes = {switch: np.abs(depths).min() for switch, (_, depths) in turns.items() if len(depths)}
            if not sizes:
                return None
            switch = min(sizes, key=lambda each: sizes[each])
            sign = 1.0 if np.median(turns[switch][1]) > 0.0 else -1.0  # pressed, or open
            for _ in range(_TOUCHES):  # of several touches in a period, that which comes first
                thetas, depths = map(np.array, orbit.turning_depths[switch])
                end = grazing_near(orbit, self.line.name, switch, float(thetas[np.argmin(sign * depths)]))
                assert end.special is not None
                orbit = end.special.orbit
                depths = sign * np.array(orbit.turning_depths[switch][1])
                if orbit.stable and depths.min() > -_ONCE * np.abs(depths).max():
                    return replace(end.with_movers(), special=None)
            return None
        except (ModelError, NumericalError, np.linalg.LinAlgError):
            return None


def _sampled(line: ParameterLine, sweep: SettledSweep) -> SettledSweep:
    """Settle some periodic motions that part by half the step, and say by how much their accelerations change."""
    parting = [k for k, motion in enumerate(sweep.lanes) if motion.period and motion.parted.any()]
    chosen = parting[:: -(-len(parting) // _SAMPLE) or 1]
    motions = list(sweep.lanes)
    for k, motion in by_half_steps(line, {k: motions[k] for k in chosen}).items():
        motions[k] = motion
    changes = [float((motions[k].error / motions[k].rms).max()) for k in chosen if not motions[k].diverged]
    if not changes:
        return sweep
    note = (
        f"half the step changes the rms accelerations of {len(changes)} periodic motions that rattle by "
        f"{100.0 * np.median(changes):.2g} % in the median, {100.0 * max(changes):.2g} % at most"
    )
    return replace(sweep, lanes=tuple(motions), notes=(*sweep.notes, note))


def by_half_steps(line: ParameterLine, motions: Mapping[int, LaneMotion]) -> dict[int, LaneMotion]:
    """Settle motions again by half the step: what changes is the error of their accelerations."""
    return {
        k: replace(motion, error=np.maximum(motion.error, np.abs(motion.rms - motions[k].rms)))
        for k, motion in settled_again(motions, line.system_at, finer=2.0).items()
    }


def _watched_on(
    line: ParameterLine, sweep: SettledSweep, gaps: Sequence[str], watched: Mapping[float, tuple[LaneMotion, ...]]
) -> SettledSweep:
    """Watch motions without period longer where a gap begins or ceases to rattle: chaos may die, or part seldom."""
    motions, notes = list(sweep.lanes), list(sweep.notes)
    while True:
        for k, motion in enumerate(motions):
            (same,) = watched.get(motion.value, (motion,))
            motions[k] = same if not motion.period and motion.is_like(same) else motion
        known = [labels_along(motions, sweep.contacts, gap) for gap in gaps]
        states = [[label.state.rattles for label in labels] for labels in known]
        changes = {k for each in states for k, (one, two) in enumerate(pairwise(each), 1) if one is not two}
        apart = {k: min(abs(k - change + 0.5) for change in changes) for k in range(len(motions)) if changes}
        open_ = [k for k in apart if not motions[k].period and motions[k].watched < LONG and not motions[k].diverged]
        near = sum(apart[k] < 1.0 for k in open_)
        if not near:
            return replace(sweep, lanes=tuple(motions), notes=tuple(notes))
        # a register takes the time of its slowest lane, whether the others are filled or not
        chosen = sorted(open_, key=lambda k: apart[k])[: -(-near // WIDTH) * WIDTH]
        for k, motion in _confirmed(line, {k: motions[k] for k in chosen}).items():
            motions[k] = motion
            if not motion.watched >= LONG:
                notes.append(f"{sweep.met}, at {motion.value:.6g}: {_DIED.format(motion.waited)}")


_DIED = "transient chaos, which died out after {} forcing periods"


def _confirmed(line: ParameterLine, motions: Mapping[int, LaneMotion]) -> dict[int, LaneMotion]:
    """Watch motions without period for long."""
    watched = settled_again(motions, line.system_at, watch=LONG)
    return {k: motion.after(motions[k]) for k, motion in watched.items()}


def inside_of(one: float, other: float, least: float) -> list[float]:
    """Return values that narrow the range of an end down: inside it, or none if it is narrow."""
    low, high = sorted((one, other))
    return np.linspace(low, high, _BETWEEN + 2)[1:-1].tolist() if high - low > least else []


def _ends(
    motions: Sequence[LaneMotion], edges: Sequence[float], sweep: SettledSweep, gaps: Sequence[str]
) -> dict[int, list[str]]:
    """Return the places of motions after which gaps begin or cease to rattle: the first of each step, few a gap."""
    found, sign = dict[int, list[str]](), sweep.direction.sign
    for gap in gaps:
        changes = [
            place
            for place, (one, other) in enumerate(pairwise(labels_along(motions, sweep.contacts, gap)))
            # an end at which a chaotic motion parts ever more seldom is nowhere to be narrowed down to
            if one.state.rattles is not other.state.rattles and not (one.seldom or other.seldom)
        ]
        first = {
            int(np.searchsorted(np.multiply(edges, sign), sign * motions[k].value, "right")): k for k in changes[::-1]
        }
        places = [place for _, place in sorted(first.items())]
        for place in dict.fromkeys((*places[:_FEW], *places[-_FEW:])):
            found.setdefault(place, []).append(gap)
    return dict(sorted(found.items()))


def lasting(system: System, sweeps: Sequence[SettledSweep]) -> str | None:
    """Say that a free vibration lasts too long for the means of motions without period; None if there is none."""
    motions = [motion for sweep in sweeps for motion in sweep.lanes if motion.watched >= LONG]
    longest = slow_modes(system, motions[0].extremes[1]).longest if motions else 0.0
    if longest * TIMES <= LONG:
        return None
    return (
        f"a free vibration takes {longest:.0f} forcing periods to decay to 1/e: where motions have no period, means of "
        f"slowly moving parts, which are taken over {LONG} periods, may differ from those of a longer run"
    )


def observed(sweeps: Sequence[SettledSweep]) -> str | None:
    """Say for how long motions without period were watched; None if there are none."""
    every = (motion for sweep in sweeps for motion in sweep.lanes)
    watched = sorted({motion.watched for motion in every if not (motion.period or motion.diverged)})
    if not watched:
        return None
    many = f"{watched[0]}" if len(watched) == 1 else f"{watched[0]} to {watched[-1]}"
    return f"motions without period were watched for {many} forcing periods: a longer transient is not excluded"


def start_values(within: tuple[float, float], steps: int, asked: int | None) -> list[float]:
    """Return the values at which motions are sought from random starts: steps of the sweeps."""
    count = _APART if asked is None else asked
    places = np.linspace(0, steps, count + 2)[1:-1] if asked is not None else np.linspace(0, steps, count + 1)
    values = np.linspace(*within, steps + 1)
    return values[np.unique(np.round(places).astype(int))].tolist()


def random_states(
    system: System, state: NDArray[np.float64], count: int, seed: int, value: float
) -> NDArray[np.float64]:
    """Return random states of physical size beside a settled motion: loose parts fly, and the soft spring swings."""
    # Kicks on every inertia would excite stiff modes at velocities that no machine knows.
    structure, assembly = system.structure, system.structure.assembly
    if not isinstance(assembly, TrainAssembly):
        return spread_starts([system], state_box(system), count, seed, value)
    random, n, found = generator(seed, value), system.size, np.tile(state, (count, 1))
    form = assembly.form
    speed = system.frequency / float(system.turns or 1)
    loose = {name.split(".", maxsplit=1)[0] for name in usual_gaps(system)}
    flies = [k for k, name in enumerate(structure.coordinates) if name in loose]
    found[:, [n + k for k in flies]] += _FLIES * speed * random.uniform(-1.0, 1.0, (count, len(flies)))
    numbers, springs = assembly.numbers(system.values), [k for k in form.springs if form.links[k].always]
    if springs:
        soft = structure.coordinates.index(form.links[min(springs, key=lambda k: float(numbers.stiffness[k]))].name)
        swings = np.resize(_SWINGS, count)
        found[:, n + soft] += swings * speed * random.uniform(-1.0, 1.0, count)
    return found


@dataclass(frozen=True, eq=False)
class Started:
    """Motions to which random starts at one value lead."""

    value: float  #: Value of the parameter.
    #: led: How many lead to each motion that the sweeps meet there; motions: the others, one for each start.
    led: tuple[int, ...]
    motions: tuple[LaneMotion, ...]

    @property
    def count(self) -> int:
        """Number of starts."""
        return sum(self.led) + len(self.motions)


def started_piece(
    system: System, parameter: str, count: int, seed: int, known: Sequence[tuple[LaneMotion, ...]]
) -> tuple[Started, ...]:
    """Follow random starts beside known motions at some values until they have settled."""
    starts = []
    for motions in known:
        value = motions[0].value
        here = ParameterLine(system, parameter).system_at(value)
        states = random_states(here, motions[0].state, count, seed, value)
        starts += [Start((value, k), value, here, each, motions) for k, each in enumerate(states)]
    ended = {start.key: motion for start, motion in settle_lanes(starts)}
    found = []
    for motions in known:
        own = [ended[motions[0].value, k] for k in range(count)]
        led = [next((k for k, each in enumerate(motions) if motion.is_like(each)), -1) for motion in own]
        new = tuple(motion for motion, k in zip(own, led, strict=True) if k < 0)
        found.append(Started(motions[0].value, tuple(led.count(k) for k in range(len(motions))), new))
    return tuple(found)


def known_at(sweeps: Sequence[SettledSweep], values: Sequence[float]) -> list[tuple[LaneMotion, ...]]:
    """Return the different motions that sweeps meet at some values."""
    found = []
    for value in values:
        here: list[LaneMotion] = []
        for motion in (motion for sweep in sweeps for motion in sweep.lanes if motion.value == value):
            if not motion.diverged and not any(motion.is_like(other) for other in here):
                here.append(motion)
        found += [tuple(here)] if here else []
    return found


def other_sweeps(
    system: System, sweeps: Sequence[SettledSweep], steps: int, started: Sequence[Started]
) -> tuple[list[SettledSweep], list[str]]:
    """Follow the motions that no sweep meets in both directions, until they become one that is known."""
    parameter, within = sweeps[0].parameter, sweeps[0].within
    values, found = np.linspace(*within, steps + 1), list[SettledSweep]()
    new, line = 0, ParameterLine(system, parameter)
    every = dict(enumerate(motion for each in started for motion in each.motions if not motion.diverged))
    chaotic = {k: motion for k, motion in every.items() if not motion.period and motion.watched < LONG}
    for motion in (every | _confirmed(line, chaotic)).values():
        if any(_meets(sweep, motion) for sweep in (*sweeps, *found)):
            continue
        new += 1
        place = int(np.argmin(np.abs(values - motion.value)))
        for direction in Direction:
            way = values[place:] if direction is Direction.UP else values[: place + 1][::-1]
            known, motions = [*sweeps, *found], [motion]

            def step(start: Start, after: LaneMotion, way=way, known=known, motions=motions) -> Start | None:
                if after.diverged or any(_meets(sweep, after) for sweep in known):
                    return None
                motions.append(after)
                if start.key + 1 >= len(way):
                    return None
                value = float(way[start.key + 1])
                return Start(start.key + 1, value, line.system_at(value), after.state)

            if len(way) > 1:
                value = float(way[1])
                for _ in settle_lanes([Start(1, value, line.system_at(value), motion.state)], step):
                    pass
            found.append(
                SettledSweep(
                    parameter, within, direction, (), (), name=OTHER, lanes=tuple(motions), contacts=sweeps[0].contacts
                )
            )
    count = len(started)
    what = f"{new or 'no'} motion{'s' * (new > 1)} beyond those of the sweeps"
    each = started[0].count if started else 0
    notes = [f"{each} random starts at each of {count} values led to {what}"]
    if not new and each:
        notes.append(
            f"at each value, with 95 % confidence, less than {300.0 / each:.3g} % of all starts lead to other motions"
        )
    return found, notes


def _meets(sweep: SettledSweep, motion: LaneMotion) -> bool:
    """Return True if a sweep has the same motion at the same value."""
    return any(other.is_like(motion) for other in sweep.lanes if other.value == motion.value)
