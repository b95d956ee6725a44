"""Pictures on the page of records whose picture on paper shows other things: shares, sweeps, families."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gapwalk.answers.shown_measure import shown_measure
from gapwalk.attractors.basins import BasinShares
from gapwalk.model.words import parameter_symbol, parameter_words
from gapwalk.picture_parts import SECTION, NamedCurve, Parts, Picture, Series, pictured
from gapwalk.plot.cells import FILLS
from gapwalk.studies.family import Family, SpecialPointPath
from gapwalk.studies.sweep_study import Sweep, Way

Json = dict[str, Any]

_DIGITS = 7  # that a screen can show


def numbers(values: ArrayLike) -> list[float | None]:
    """Return numbers with the digits that a screen can show; None for what is not finite."""
    array = np.asarray(values, dtype=float)
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in array.tolist()]


@pictured(BasinShares, forms=())
def shares_picture(found: BasinShares) -> Picture:
    """Describe the share of random starts that lead to each attractor, with its confidence limits."""
    shares = ", ".join(f"{each.name} {each.share:.1%}" for each in found.shares)
    bars = [
        {
            "name": each.name,
            "share": each.share,
            "low": each.low,
            "high": each.high,
            "text": f"{each.share:.1%} ({each.low:.1%} to {each.high:.1%})",
            "color": FILLS[number % len(FILLS)],
        }
        for number, each in enumerate(found.shares)
    ]
    said = [f"Of {len(found.labels):,} random starts: {shares}"]
    return Picture(found.system, parts=lambda: Parts(more={"shares": bars}), sentences=said)


_LEVELS = 700  # of the section points at one value: points nearer to each other than a pixel are drawn once
_SAID = 5  # bands that the sentence names
_COORDINATES = 4  # whose sections are drawn
_MOST = 6000  # points of one order of values that a page draws without waiting
_LOOKS = {
    Way.UP: ("rising", "rising parameter"),
    Way.DOWN: ("falling", "falling parameter"),
    Way.AGAIN: ("main", "each value from the start"),
}


@pictured(Sweep, forms=())
def sweep_picture(found: Sweep) -> Picture:
    """Describe the points of the section over the parameter, in a colour for each order of the values."""
    return Picture(
        found.system,
        (found.parameter, f"{SECTION}{found.system.coordinates[0]}"),
        (),
        partial(_parts_of_sweep, found),
        sentences=_bands_met(found),
    )


def _bands_met(found: Sweep) -> list[str]:
    """Return the motions that the first direction meets, one after the other; nothing if there are none yet."""
    way, bands = found.lanes[0].way, found.bands(0)
    if not bands:
        return []
    bands = bands[::-1] if way is Way.DOWN else bands
    ends = [band.low if way is Way.DOWN else band.high for band in bands]
    met = ", ".join(f"{band.regime} to {end:.4g}" for band, end in zip(bands[:_SAID], ends[:_SAID], strict=True))
    more = f", and {len(bands) - _SAID} more" if len(bands) > _SAID else ""
    return [f"{_LOOKS[way][1].capitalize()}: {met}{more}"]


def _parts_of_sweep(found: Sweep) -> Parts:
    ways = [way for way in Way if any(lane.way is way for lane in found.lanes)]
    coordinates = found.system.coordinates[:_COORDINATES]
    return Parts(
        layers=[_layer(found, way, each) for each in coordinates for way in ways],
        quantities=[f"{SECTION}{each}" for each in coordinates],
        within={found.parameter: (float(found.values[0]), float(found.values[-1]))},
    )


def _layer(found: Sweep, way: Way, coordinate: str) -> Series:
    """Return the points of all lanes of one order, without those that a screen cannot tell apart."""
    parts = [found.section(coordinate, place) for place, lane in enumerate(found.lanes) if lane.way is way]
    x, y = (np.concatenate(each) for each in zip(*parts, strict=True))
    if len(y):
        height = float(np.ptp(y)) or 1.0
        level = np.rint((y - y.min()) / height * _LEVELS)
        _, places = np.unique(np.column_stack([x, level]), axis=0, return_index=True)
        places = places[:: -(-len(places) // _MOST)]
        x, y = x[places], y[places]
    return Series(x, y, "dots", *_LOOKS[way], axes=(found.parameter, f"{SECTION}{coordinate}"))


@pictured(Family, forms=())
def family_picture(found: Family, measure: str = "") -> Picture:
    """Describe the branches of all members, and their special points joined from one to the next."""
    names = tuple(name for name in found.over.names if name in found.system.parameters)
    name = parameter_symbol(found.over.name, found.system.units if found.over.name in names else None)
    values = [member.value for member in found.members]
    ends = f"{len(values)} values of {name} from {values[0]:.6g} to {values[-1]:.6g}"
    several = [path for path in found.point_paths if len(path.places) > 1]
    return Picture(
        found.system,
        (found.parameter, measure or shown_measure(found.system, None)),
        [
            NamedCurve(f"{each} at {found.over.name} = {member.value:.6g}", branch)
            for member in found.members
            for each, branch in member.named
        ],
        partial(_parts_of_family, found, several),
        sentences=[f"{ends}: {len(several)} special points go on through members, each joined to the next"],
        parameters=names,
        script="record.branches",
    )


def _parts_of_family(found: Family, several: list[SpecialPointPath]) -> Parts:
    """Return the depth of each curve in three dimensions, and the paths of special points."""
    name = found.over.name
    words = parameter_words(name, found.system.units) if name in found.system.parameters else name
    values = [member.value for member in found.members for _ in member.branches]
    places: dict[tuple[int, int], int] = {}
    for member in found.members:
        for index in range(len(member.branches)):
            places[member.number, index] = len(places)
    ribs = [_rib(path, places) for path in several]
    more = {"space": {"words": words, "values": values}, "ribs": ribs}
    return Parts(within={found.parameter: found.within}, more=more)


def _rib(path: SpecialPointPath, places: dict[tuple[int, int], int]) -> Json:
    """Return the special points of a path by the indices of their curves; inexact where a connection is a guess."""
    points = [[places[place.member, place.branch], place.special] for place in path.places]
    return {"kind": path.kind.value, "text": path.name, "exact": path.exact, "points": points}
