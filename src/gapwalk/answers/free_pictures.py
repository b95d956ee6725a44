"""Pictures of free motions: backbones, what they foretell, equilibria, and self-excited motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.free import backbone_curve, rest_walk
from gapwalk.free.backbone_curve import Backbone
from gapwalk.free.island_births import Backbones, Foretold
from gapwalk.free.rest_walk import Rests
from gapwalk.free.self_excitation import SelfExcited
from gapwalk.model.system import System
from gapwalk.model.words import measure_words, parameter_words, signal_words
from gapwalk.picture_parts import NamedCurve, Panel, Parts, Picture, Series, Whole, events_of, look_of, pictured

_COORDINATES = 6  # whose amplitudes the page draws
_ROOM = 2.5  # height of a picture with a response, in its largest amplitude
_OF_BACKBONES = dict(zip(backbone_curve.EVENTS, ("turn", "crossing"), strict=True))  # symbols
_OF_RESTS = dict(zip(rest_walk.EVENTS, ("hopf", "fold", "crossing", "border"), strict=True))
_SPAN = 30.0  # largest load that is shown, in the largest birth or in the median of all


@pictured(Backbone, Backbones, size=(7.5, 5.6), forms=("panels",))
def backbones_picture(
    found: Backbone | Backbones, measure: str = "half", *, response: Branch | Sequence[Branch] = ()
) -> Picture:
    """Describe amplitudes over the frequency, a response beside them, and the frequency over the energy."""
    lines = (found,) if isinstance(found, Backbone) else found.lines
    if not lines:
        return Picture(None, empty="there is no backbone yet, so there is nothing to draw")
    system = lines[0].system
    what, _, coordinate = measure.partition(".")
    coordinate = coordinate or (measure if measure in system.coordinates else system.coordinates[0])
    if what not in ("half", coordinate) or coordinate not in system.coordinates:
        raise ModelError(f"measure is {measure!r}; a picture of backbones shows half of a coordinate, as in half.q1")
    branches = [response] if isinstance(response, Branch) else list(response)
    axes, reach = (system.structure.pace, f"half.{coordinate}"), {}
    if branches:  # it follows a backbone up to its peak, far below the largest free vibrations
        reach = {axes[1]: (0.0, _ROOM * max(point.measure(axes[1]) for each in branches for point in each.points))}
    texts = [text for line in lines for text in line.summary() if isinstance(text, str)]
    return Picture(
        system,
        axes,
        [NamedCurve("response", each) for each in branches],
        partial(_parts_of_backbones, lines, coordinate),
        sentences=[text for text in texts if "backbone" in text[:8]],
        wholes=[Whole("backbones over frequency and energy", found)],
        panels=("main", "charts"),
        words=(_pace_words(system, shared=bool(branches)), f"amplitude of {signal_words(coordinate, system.units)}"),
        reach=reach,
    )


def _pace_words(system: System, *, shared: bool) -> str:
    """Return the label of the axis of frequencies: a free vibration has its own; short if the axis is shared."""
    pace = system.structure.pace
    words = parameter_words(pace, system.units)
    if pace != "frequency":
        return words
    _, bracket, unit = words.partition(" [")
    return f"frequency{'' if shared else ' of the free vibration'}{bracket}{unit}"


def _parts_of_backbones(lines: Sequence[Backbone], coordinate: str) -> Parts:
    system = lines[0].system
    pace, names = system.structure.pace, system.coordinates[:_COORDINATES]
    values = np.concatenate([line.values for line in lines])
    # under a mean load the energy may pass zero, which its logarithmic axis has not
    has_energy = all(np.isfinite(line.energies).all() and line.energies.min() > 0.0 for line in lines)
    energies = Panel(
        _pace_words(system, shared=True),
        pace,
        list(_energies(lines)) if has_energy else [],
        fitted=True,
        across="energy",
        logarithmic="x",
    )
    return Parts(
        layers=[each for name in dict.fromkeys((*names, coordinate)) for each in _amplitudes(lines, name)],
        charts=[energies] * has_energy,
        within={pace: (float(values.min()), float(values.max()))},
        quantities=[f"half.{name}" for name in names],
    )


def _amplitudes(lines: Sequence[Backbone], coordinate: str) -> Iterator[Series]:
    system = lines[0].system
    place, axes = system.coordinates.index(coordinate), (system.structure.pace, f"half.{coordinate}")
    for number, line in enumerate(lines):
        touches = [point.touches for point in line.points]
        look = look_of(number)
        yield Series(line.values, line.half(coordinate), "line", look, line.name, axes=axes, corners=touches)
    events = [(event.kind, event.value, event.point.half[place]) for line in lines for event in line.events]
    yield from events_of(_OF_BACKBONES, events, axes)


def _energies(lines: Sequence[Backbone]) -> Iterator[Series]:
    """Yield the frequency over the energy."""
    for number, line in enumerate(lines):
        touches, look = [point.touches for point in line.points], look_of(number)
        yield Series(line.energies, line.values, "line", look, line.name, corners=touches)
    events = [(event.kind, event.point.energy, event.value) for line in lines for event in line.events]
    yield from events_of(_OF_BACKBONES, events)


@pictured(Foretold, size=(7.5, 4.6), forms=("axes",))
def foretold_picture(found: Foretold, coordinate: str = "") -> Picture:
    """Describe the amplitude of the load over that of the motion, one line for each harmonic, with births."""
    system = found.line.system
    coordinate = coordinate or system.coordinates[0]
    axes = f"half.{coordinate}", f"{found.load}.amplitude"
    finite = found.amplitudes[np.isfinite(found.amplitudes) & (found.amplitudes > 0.0)]
    births = [birth.amplitude for birth in found.births] or [float(np.median(finite))]
    reach = {axes[1]: (max(float(finite.min()), min(births) / _SPAN), _SPAN * max(births))}
    return Picture(system, axes, (), lambda: Parts(layers=list(_loads(found, coordinate, axes))),
                   words=(measure_words(axes[0], system.units), ""), reach=reach, logarithmic="y")  # fmt: skip


def _loads(found: Foretold, coordinate: str, axes: tuple[str, str]) -> Iterator[Series]:
    half, place = found.line.half(coordinate), found.line.system.coordinates.index(coordinate)
    for number, harmonic in enumerate(found.harmonics):
        column = found.amplitudes[:, number]
        if np.isfinite(column).any():
            y, look = np.where(np.isfinite(column), column, np.nan), look_of(number)
            yield Series(half, y, "line", look, f"harmonic {harmonic}", axes=axes)
    for joins, symbol, text in ((False, "birth", "an isolated branch is born"), (True, "crossing", "branches join")):
        births = [birth for birth in found.births if bool(birth.joins) is joins]
        if births:
            x, y = [birth.point.half[place] for birth in births], [birth.amplitude for birth in births]
            yield Series(x, y, "stars", "worst", text, axes=axes, symbol=symbol)


@pictured(Rests, size=(7.5, 4.2), forms=("axes",))
def rests_picture(line: Rests, coordinate: str = "") -> Picture:
    """Describe a coordinate of equilibria over the parameter, dashed where they are unstable."""
    measure = f"max.{_checked(line, coordinate)}"
    parts = partial(_equilibria, line, measure)
    words = "", signal_words(measure.partition(".")[2], line.system.units)
    return Picture(line.system, (line.parameter, measure), (), lambda: Parts(layers=list(parts())), words=words)


def _checked(line: Rests, coordinate: str) -> str:
    names = line.system.coordinates
    coordinate = coordinate or names[0]
    if coordinate not in names:
        raise ModelError(f"coordinate is {coordinate!r}; it must be one of {', '.join(names)}")
    return coordinate


def _equilibria(line: Rests, measure: str) -> Iterator[Series]:
    """Yield the equilibria over the parameter, stable and unstable, and what happens along them."""
    coordinate, axes = measure.partition(".")[2], (line.parameter, measure)
    values, heights = line.values, line.coordinate(coordinate)
    stable = np.array([point.stable for point in line.points])
    for held, look, text in ((True, "torus", "stable equilibrium"), (False, "torus-unstable", "unstable equilibrium")):
        own = stable == held
        drawn = own.copy()
        if not held:  # the step between a stable and an unstable point is drawn as unstable
            drawn[:-1] |= own[1:]
            drawn[1:] |= own[:-1]
        if drawn.any():
            yield Series(values, np.where(drawn, heights, np.nan), "line", look, text, axes=axes)
    place = line.system.coordinates.index(coordinate)
    events = [(event.kind, event.value, event.point.position[place]) for event in line.events]
    yield from events_of(_OF_RESTS, events, axes, rest_walk.BORDER)


@pictured(SelfExcited, size=(7.5, 6.4), forms=("panels",))
def self_excited_picture(found: SelfExcited, coordinate: str = "", *, labels: bool = True) -> Picture:
    """Describe equilibria with the largest and smallest values of the motions above the frequency of the motions."""
    coordinate, units = _checked(found.rests[0], coordinate), found.system.units
    # a value next to 1 without digits that are rounding errors
    points = [f"{each.words} at {found.parameter} = {round(each.value, 12) + 0.0:.8g}" for each in found.hopf_points]
    count = len(found.cycles)
    branches = f"{count} {'branch' if count == 1 else 'branches'} of self-excited motions"
    return Picture(
        found.system,
        (found.parameter, f"max.{coordinate}"),
        [NamedCurve(f"motions {number}", each) for number, each in enumerate(found.cycles, start=1)],
        partial(_parts_of_self_excited, found, coordinate),
        sentences=["; ".join([branches, *points])],
        script="list(record.cycles)",
        wholes=[Whole("equilibria and motions over the parameter", found)],
        words=("", signal_words(coordinate, units)),
        labels=labels,
        reach={},
    )


def _parts_of_self_excited(found: SelfExcited, coordinate: str) -> Parts:
    system = found.system
    pace, axes = system.structure.pace, (found.parameter, f"max.{coordinate}")
    names = [f"{kind}.{each}" for each in system.coordinates[:_COORDINATES] for kind in ("max", "min")]
    words = "frequency of the motion" if system.units is None else parameter_words(pace, system.units)

    def frequency(point: BranchPoint) -> float:
        return point.orbit.system[pace]

    def lowest(point: BranchPoint) -> float:
        return point.measure(f"min.{coordinate}")

    text = "self-excited motion"
    along = [
        Series(each.values, [*map(frequency, each.points)], text=text, along=(each, frequency)) for each in found.cycles
    ]
    return Parts(
        layers=[
            each
            for name in dict.fromkeys((*names, axes[1]))
            for line in found.rests
            for each in _equilibria(line, name)
        ],
        paper=[Series([], [], axes=axes, along=(each, lowest)) for each in found.cycles],
        below=[Panel(words, found.parameter, along, fitted=True)] if along else [],
        within={found.parameter: found.within},
        quantities=names,
    )
