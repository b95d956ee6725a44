"""Pictures of tori: families over their parameter with lockings and rotation numbers, single tori, and tongues."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gapwalk.model.system import System
from gapwalk.model.words import full_measure
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
