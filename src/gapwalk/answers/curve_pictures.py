"""Pictures of free motions: backbones, what they foretell, equilibria, and self-excited motions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gapwalk.bifurcation.branch import Branch
from gapwalk.continuation.curve_points import BranchPoint
from gapwalk.errors import ModelError
from gapwalk.free import backbone_curve
from gapwalk.free import equilibrium_walk as rest_walk
from gapwalk.free.backbone_curve import Backbone
from gapwalk.free.equilibrium_walk import Rests
from gapwalk.free.island_births import Backbones, Foretold
from gapwalk.free.self_excitation import SelfExcited
from gapwalk.model.measures import full_measure
from gapwalk.model.system import System
from gapwalk.model.words import measure_words, parameter_words, signal_words
from gapwalk.picture_parts import (
    SECTION,
    NamedCurve,
    Panel,
    Parts,
    Picture,
    Series,
    Shade,
    Whole,
    events_of,
    look_of,
    pictured,
)
from gapwalk.tori.tongue import Tongue
from gapwalk.tori.torus import TURN, Torus, at_phases
from gapwalk.tori.torus_family import TorusDiagram, TorusEventKind, TorusFamily

_FREE_COORDINATES = 6  # whose amplitudes the page draws
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
    pace, names = system.structure.pace, system.coordinates[:_FREE_COORDINATES]
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
    names = [f"{kind}.{each}" for each in system.coordinates[:_FREE_COORDINATES] for kind in ("max", "min")]
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


# Pictures of tori: families over their parameter with lockings and rotation numbers, single tori, and tongues.

_SYMBOLS = {kind.value: kind.name.lower() for kind in TorusEventKind}
_COORDINATES = 4  # whose measures the page draws
_PICTURES = 6  # of single tori
_FINE = 400  # points of a curve
_CLOSE = 0.35  # share of the range around the tori that is shown on paper beside them
_STABLE, _UNSTABLE = ("torus", "torus, stable"), ("torus-unstable", "torus, unstable")


@pictured(TorusFamily, size=(7.5, 5.6), forms=("panels",))
def torus_family_picture(family: TorusFamily, measure: str = "half", *, labels: bool = True) -> Picture:
    """Describe a measure and the rotation number of a family of tori over its parameter."""
    system = family.points[0].torus.system
    measure = full_measure(measure, system.coordinates)
    parts = partial(_parts_of_families, (family,), family.parameter, measure, system, labels=labels)
    wholes = _wholes(family, (family,), family.parameter)
    return Picture(system, (family.parameter, measure), (), parts, wholes=wholes)


@pictured(TorusDiagram, size=(8.0, 6.4), forms=("panels",))
def torus_diagram_picture(found: TorusDiagram, measure: str = "half", *, labels: bool = True) -> Picture:
    """Describe the branches with the families of tori above the rotation numbers of the tori."""
    members, families, parameter = found.diagram.members, found.families, found.diagram.parameter
    said = [next(text for text in found.summary() if isinstance(text, str))]
    if not (members or families):
        return Picture(None, sentences=said, empty="there are no tori and no motions, so there is nothing to draw")
    # with a second tone no motion is periodic
    system = members[0].branch.points[0].orbit.system if members else families[0].points[0].torus.system
    measure = full_measure(measure, system.coordinates)
    whole, *tori = _wholes(found, families, parameter)
    tongues = [Whole("tongues over both parameters", list(found.tongues))] if found.tongues else []
    within, reach = found.diagram.within, {}
    if members and families:
        values = np.concatenate([family.values for family in families])
        low, high = float(values.min()), float(values.max())
        room = _CLOSE * (high - low)
        reach = {parameter: (max(within[0], low - room), min(within[1], high + room))}
    return Picture(
        system,
        (parameter, measure),
        [NamedCurve(member.name, member.branch) for member in members],
        partial(_parts_of_families, families, parameter, measure, system, found.tongues, within, labels=labels),
        sentences=said,
        wholes=[whole, *tongues, *tori],
        parameters=tuple(dict.fromkeys(tongue.second for tongue in found.tongues)),
        script="[member.branch for member in record.diagram.members]",
        labels=labels,
        height=1.3,
        reach=reach,
    )


def _wholes(found: object, families: Sequence[TorusFamily], parameter: str) -> list[Whole]:
    """Return the picture of the whole, and those of some tori of each family, in the section and in space."""
    some = max(1, _PICTURES // max(1, len(families)))
    return [
        Whole("all tori over the parameter", found),
        *(
            _whole(torus, f"T{number}, {parameter} = {torus.system[parameter]:.8g}")
            for number, family in enumerate(families[:_PICTURES], start=1)
            for torus in _some(family, some)
        ),
    ]


def _some(family: TorusFamily, count: int) -> list[Torus]:
    """Return the largest torus of a family and others that are spread along it, in order along the family."""
    sizes = [point.torus.size for point in family.points]
    places = [int(np.argmax(sizes)), *np.linspace(0, len(sizes) - 1, count + 1)[1:].round().astype(int).tolist()]
    return [family.points[place].torus for place in sorted(list(dict.fromkeys(places))[:count])]


def _whole(torus: Torus, text: str) -> Whole:
    rotation = f"rotation number {torus.rotation:.8g}"
    return Whole(f"{text}: {rotation}", torus, "png", {"title": f"{text}, {rotation}"})


def _parts_of_families(
    families: Sequence[TorusFamily],
    over: str,
    measure: str,
    system: System,
    tongues: Sequence[Tongue] = (),
    within: tuple[float, float] | None = None,
    *,
    labels: bool,
) -> Parts:
    """Return the families over their parameter, windows in which motions lock, rotation numbers, and tongues."""
    names = [f"{kind}.{each}" for each in system.coordinates[:_COORDINATES] for kind in ("half", "max", "min")]
    windows = [event.window for family in families for event in family.events if event.window is not None]
    layers = [
        each
        for name in dict.fromkeys((*names, measure))
        for family in families
        for each in _lines(family, family.measure(name), (over, name))
    ]
    rotations = Panel("rotation number", over, list(_rotations(families, labels)), fitted=True)
    return Parts(
        layers=[*layers, *(each for each in _tongue_lines(tongues))],
        shades=[Shade(over, each.low, each.high, "goal", "locked to a periodic motion") for each in windows],
        below=[rotations] if families else [],
        within={} if within is None else {over: within},
        quantities=names,
    )


def _lines(family: TorusFamily, heights: NDArray[np.float64], axes: tuple[str, ...] = ()) -> Iterator[Series]:
    """Yield the stable and the unstable part of a family; a step from one to the other counts as unstable."""
    values, stable = family.values, np.array([point.torus.stable for point in family.points])
    if len(values) == 1:
        yield Series(values, heights, "dots", *(_STABLE if stable[0] else _UNSTABLE), axes=axes)
        return
    steps = stable[:-1] & stable[1:]
    for held, look in ((True, _STABLE), (False, _UNSTABLE)):
        own = steps == held
        if own.any():
            # a value that is left out cuts the line: between two points of which no step is drawn, one is left out
            drawn = np.append(own, False) | np.append(False, own)
            cuts = np.flatnonzero(~own & drawn[:-1] & drawn[1:]) + 1
            x = np.insert(np.where(drawn, values, np.nan), cuts, np.nan)
            y = np.insert(np.where(drawn, heights, np.nan), cuts, np.nan)
            yield Series(x, y, "line", *look, axes=axes)


def _rotations(families: Sequence[TorusFamily], labels: bool) -> Iterator[Series]:
    for family in families:
        yield from _lines(family, family.rotations)
    events = [event for family in families for event in family.events]
    places = [(each.kind, each.value, each.rotation) for each in events]
    yield from events_of(_SYMBOLS, places, faint=TorusEventKind.RESONANCE)
    named = [each for each in events if labels and each.ratio is not None]
    if named:
        x, y = [each.value for each in named], [each.rotation for each in named]
        yield Series(x, y, "none", notes=[str(each.ratio) for each in named])


def _tongue_lines(tongues: Sequence[Tongue]) -> Iterator[Series]:
    for number, tongue in enumerate(tongues):
        axes, look = (tongue.first, tongue.second), look_of(number)
        for side in tongue.sides:
            x, y = side.values.T
            yield Series(x, y, "line", look, f"tongue {tongue.ratio}", axes=axes)
        yield from _tips([tongue])


def _tips(tongues: Sequence[Tongue]) -> Iterator[Series]:
    for tongue in tongues:
        if tongue.tip is not None:
            first, second = tongue.tip.values
            yield Series([first], [second], "stars", "worst", "tip", axes=(tongue.first, tongue.second), symbol="tip")


@pictured(Tongue, size=(7.5, 4.8), forms=("axes",), several=True)
def tongue_picture(found: Tongue | Sequence[Tongue], *, labels: bool = True) -> Picture:
    """Describe both sides of a tongue, or of several, over both parameters, and the regions between them."""
    tongues = [found] if isinstance(found, Tongue) else list(found)
    axes = tongues[0].first, tongues[0].second
    curves, regions = list[NamedCurve](), list[Series]()
    for number, tongue in enumerate(tongues):
        look = look_of(number)
        text = f"folds of period {tongue.period}: locked {tongue.ratio} between them"
        named = zip(("lower", "upper"), tongue.sides, strict=True)
        curves += [NamedCurve(f"{name} side", side, look, text) for name, side in named]
        (x, y), (across, up) = _outline(tongue).T, tongue.sides[0].values[np.argmax(tongue.sides[0].values[:, 1])]
        note = Series([across], [up], "none", look, axes=axes, notes=[str(tongue.ratio)] if labels else [])
        regions += [Series(x, y, "region", look, axes=axes), note]
    return Picture(
        tongues[0].sides[0].points[0].orbit.system,
        axes,
        curves,
        lambda: Parts(layers=list(_tips(tongues)), paper=regions),
        wholes=[Whole("the tongue over both parameters", found)],
        script="list(record.sides)",
    )


def _outline(tongue: Tongue) -> NDArray[np.float64]:
    """Return the points along one side, to the tip if there is one, and back along the other side."""
    one, other = (side.values for side in tongue.sides)
    size = np.ptp(np.concatenate((one, other)), axis=0)
    size[size == 0.0] = 1.0  # a tongue too narrow to be followed has one point on each side
    if tongue.tip is not None:
        tip = np.array(tongue.tip.values)
        one, other = (
            each if _far(each[0], tip, size) > _far(each[-1], tip, size) else each[::-1] for each in (one, other)
        )
        return np.concatenate((one, [tip], other[::-1]))
    if _far(one[-1], other[-1], size) > _far(one[-1], other[0], size):
        other = other[::-1]
    return np.concatenate((one, other[::-1]))


def _far(one: NDArray[np.float64], other: NDArray[np.float64], size: NDArray[np.float64]) -> float:
    return float(np.abs((one - other) / size).max())


@pictured(Torus, forms=())
def torus_picture(torus: Torus) -> Picture:
    """Describe each curve of a torus in the sections of all coordinates."""
    name, names = torus.system.coordinates[0], torus.system.state_names
    return Picture(
        torus.system,
        (f"{SECTION}{name}", f"{SECTION}{name}'"),
        (),
        lambda: Parts(layers=list(_sections(torus)), quantities=[f"{SECTION}{each}" for each in names]),
        sentences=[repr(torus)],
        wholes=[_whole(torus, "in the section, and in space")],
    )


def _sections(torus: Torus) -> Iterator[Series]:
    for place, name in enumerate(torus.system.coordinates[:_COORDINATES]):
        axes = (f"{SECTION}{name}", f"{SECTION}{name}'")
        for number, curve in enumerate(torus.sections):
            closed = at_phases(curve, np.linspace(0.0, TURN, _FINE))
            text = "the curve" if len(torus.sections) == 1 else f"forcing period {number + 1} of {len(torus.sections)}"
            x, y = closed[:, place], closed[:, torus.system.size + place]
            yield Series(x, y, "line", look_of(number), text, axes=axes)
