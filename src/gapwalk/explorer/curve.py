"""A branch or a locus as arrays for the page: any quantity over any other, stability, and special points."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from gapwalk.bifurcation.locus import Codim2Point, LocusPoint
from gapwalk.continuation.branch import Kind, SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.explorer.entry import Line
from gapwalk.orbit.measures import MEASURES
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.map_style import CODIM2
from gapwalk.plot.style import SYMBOLS
from gapwalk.study.map import KINDS

LABELS = ("stable", "below", "above", "pair", *(kind.value for kind in KINDS))
"""Kinds of stability (see `Instability.label`), then kinds of loci, by the numbers that stand for them."""

MEASURE = "measure:"
"""Stands before the name of a measure that is also that of a parameter: ``mean.q1`` is a mean load by itself."""

_PART = 40  # orbits of which a measure is computed at once: a click waits no longer than for these


def quantity(orbit: Orbit, name: str) -> float:
    """A parameter of an orbit's system, or a measure of the orbit, by name (see `MEASURE`)."""
    return orbit.system[name] if name in orbit.system.parameters else orbit.measure(name.removeprefix(MEASURE))


class Quantities:
    """Two quantities of the orbits of a line; where that takes integrations, they are computed in small parts.

    Parameters
    ----------
    line
        The branch or the locus.
    names
        Names of parameters or measures.
    first
        The first point that is wanted.
    """

    def __init__(self, line: Line, names: tuple[str, str], first: int = 0) -> None:
        self.line, self.names, self.first = line, names, first
        self._computed: dict[tuple[int, str], float] = {}

    def of(self, orbit: Orbit) -> tuple[float, float]:
        """Those of one orbit."""
        x, y = (self._computed.get((id(orbit), name)) for name in self.names)
        return (
            quantity(orbit, self.names[0]) if x is None else x,
            quantity(orbit, self.names[1]) if y is None else y,
        )

    def parts(self) -> Iterator[Callable[[], None]]:
        """What takes integrations, part by part; nothing if all is known already."""
        orbits = [each.orbit for each in (*self.line.points[self.first :], *self.line.special_points)]
        for name in dict.fromkeys(self.names):
            missing = [orbit for orbit in orbits if not _is_at_hand(orbit, name)]
            for start in range(0, len(missing), _PART):
                yield lambda part=missing[start : start + _PART], name=name: self._compute(part, name)

    def _compute(self, orbits: Sequence[Orbit], name: str) -> None:
        self._computed.update({(id(orbit), name): quantity(orbit, name) for orbit in orbits})


def _is_at_hand(orbit: Orbit, name: str) -> bool:
    """Whether a quantity is known without an integration."""
    if name in orbit.system.parameters:
        return True
    kind, _, signal = name.removeprefix(MEASURE).partition(".")
    return kind in MEASURES and signal in orbit.system.coordinates and "extremes" in vars(orbit)


def curve_of(wanted: Quantities) -> dict[str, Any]:
    """The points and special points of a branch, or of a locus, in the order of the walk.

    Parameters
    ----------
    wanted
        Which quantities of which line, and from which point on: a branch that grows is asked for its new points only.

    Returns
    -------
    dict
        ``x``, ``y`` (float64), ``node`` (int32: the number of a point, or -1 - the number of a special point), and
        ``label`` (uint8: the place in `LABELS` of what follows), each in base64, little-endian; ``count``, the points
        of the line; and ``special``, all its special points.
    """
    line, first = wanted.line, wanted.first
    points, special = line.points, line.special_points
    begin = points[first].arclength if first and first < len(points) else -np.inf
    nodes = [(point.arclength, i, point.orbit, _label(point, line)) for i, point in enumerate(points) if i >= first]
    if first < len(points):
        nodes += [
            (each.point.arclength, -1 - i, each.orbit, _label(each, line))
            for i, each in enumerate(special)
            if each.point.arclength >= begin
        ]
    nodes.sort(key=lambda node: node[0])
    places = [wanted.of(orbit) for _, _, orbit, _ in nodes]
    return {
        "count": len(points),
        "x": _packed([x for x, _ in places], "<f8"),
        "y": _packed([y for _, y in places], "<f8"),
        "node": _packed([node for _, node, _, _ in nodes], "<i4"),
        "label": _packed([LABELS.index(label) for *_, label in nodes], "u1"),
        "special": [_at(wanted.of(each.orbit)) | _about(each) for each in special],
    }


def _label(each: BranchPoint | SpecialPoint | LocusPoint | Codim2Point, line: Line) -> str:
    """What the line looks like from a point on: how stable its motions are; what happens on a locus."""
    if isinstance(each, BranchPoint):
        return each.instability.label
    if isinstance(each, SpecialPoint):
        return each.after.label
    assert line.kind is not None  # these lie on loci
    return line.kind.value


def _at(place: tuple[float, float]) -> dict[str, Any]:
    return dict(zip("xy", place, strict=True))


def _about(each: SpecialPoint | Codim2Point) -> dict[str, Any]:
    return _codim2(each) if isinstance(each, Codim2Point) else _special(each)


def _special(special: SpecialPoint) -> dict[str, Any]:
    style, multiplier = SYMBOLS[special.kind], special.multiplier
    return {
        "kind": special.kind.value,
        "text": style.text,
        "label": style.label,
        "value": special.value,
        "uncertainty": special.uncertainty,
        "change": special.change,
        "nature": special.nature,
        "contact": special.contact,
        "multiplier": None if np.isnan(multiplier) else [multiplier.real, multiplier.imag],
        "has_locus": special.kind in KINDS,
        "switches": special.kind in (Kind.FLIP, Kind.BRANCH_POINT),
    }


def _codim2(codim2: Codim2Point) -> dict[str, Any]:
    style = CODIM2[codim2.kind]
    return {
        "kind": f"codim2 {codim2.kind.value}",
        "text": f"{style.text} ({style.label})" if style.label and style.label not in style.text else style.text,
        "label": style.label,
        "values": list(codim2.values),
        "contact": codim2.contact,
        "has_locus": False,
        "switches": False,
    }


def _packed(values: Sequence[float], kind: str) -> str:
    return base64.b64encode(np.array(values, dtype=kind).tobytes()).decode("ascii")
