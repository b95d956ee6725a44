"""Branches and loci as arrays for the page: any quantity over any other, stability, and special points."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from gapwalk.bifurcation.loci import Codim2Point, LocusPoint
from gapwalk.bifurcation.special_point import SpecialPoint, at_once, words_of
from gapwalk.bifurcation.special_point_kind import Kind
from gapwalk.continuation.point_on_branch import BranchPoint
from gapwalk.explorer.axis_quantities import is_at_hand, quantity
from gapwalk.explorer.exploration import Line
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.style import CODIM2, locus_style, symbol_style

_STABILITY = ("stable", "below", "above", "pair", "neutral")


def labels() -> tuple[str, ...]:
    """Return the kinds of stability (see `Instability.label`), then of loci; the page receives their indices.

    Their order is that of the lines in ``page/curves.js``, which takes those of loci from `locus_lines`.
    """
    return (*_STABILITY, *Kind.with_locus())


def locus_lines() -> list[dict[str, Any]]:
    """Describe the lines of loci for the page, in the order of `labels`: kind, legend, colour, dashes and width."""
    lines = []
    for kind in Kind.with_locus():
        dashes = kind.symbol.dashes
        lines.append(
            {
                "kind": kind.value,
                "text": locus_style(kind).text,
                "color": kind.symbol.color,
                "dashes": list(dashes[1]) if isinstance(dashes, tuple) else [],
                "width": kind.symbol.width,
            }
        )
    return lines


_PART = 40  # orbits of which a measure is computed at once: a click waits no longer than for these


class Node(NamedTuple):
    """Place on a line: the index of a point, or -1 - that of a special point, and the label of what follows it."""

    number: int
    orbit: Orbit
    label: int


class Quantities:
    """Two quantities of the orbits of a line; where that takes integrations, they are computed in small parts."""

    def __init__(self, line: Line, names: tuple[str, str], first: int = 0) -> None:
        self.line, self.names, self.first = line, names, first
        self._computed: dict[tuple[int, str], float] = {}

    def of(self, orbit: Orbit) -> tuple[float, float]:
        """Return both quantities of one orbit."""
        x, y = (self._computed.get((id(orbit), name)) for name in self.names)
        first, second = self.names
        return quantity(orbit, first) if x is None else x, quantity(orbit, second) if y is None else y

    def parts(self) -> Iterator[Callable[[], None]]:
        """Yield the computations that need integrations, part by part."""
        orbits = [each.orbit for each in (*self.line.points[self.first :], *self.line.special_points)]
        for name in dict.fromkeys(self.names):
            missing = [orbit for orbit in orbits if not is_at_hand(orbit, name)]
            for start in range(0, len(missing), _PART):
                yield lambda part=missing[start : start + _PART], name=name: self._compute(part, name)

    def _compute(self, orbits: Sequence[Orbit], name: str) -> None:
        self._computed.update({(id(orbit), name): quantity(orbit, name) for orbit in orbits})


def curve_of(wanted: Quantities) -> dict[str, Any]:
    """Return the points and special points of a branch or a locus in the order of the walk."""
    line = wanted.line
    nodes = nodes_of(line.points, line.special_points, wanted.first, line.kind)
    places = [wanted.of(node.orbit) for node in nodes]
    return {
        "count": len(line.points),
        "x": _packed([x for x, _ in places], "<f8"),
        "y": _packed([y for _, y in places], "<f8"),
        "node": _packed([node.number for node in nodes], "<i4"),
        "label": _packed([node.label for node in nodes], "u1"),
        "special": [
            words | dict(zip("xy", map(finite, wanted.of(each.orbit)), strict=True))
            for words, each in zip(special_words(line), line.special_points, strict=True)
        ],
    }


def nodes_of(
    points: Sequence[BranchPoint | LocusPoint],
    special_points: Sequence[SpecialPoint | Codim2Point],
    first: int = 0,
    kind: Kind | None = None,
) -> list[Node]:
    """Return the points and special points of a line in the order of the walk, from the point of index `first` on.

    `kind` is the kind of a locus; None for a branch.
    """
    begin = points[first].arclength if first and first < len(points) else -np.inf
    nodes = [
        (point.arclength, Node(i, point.orbit, _label(point, kind))) for i, point in enumerate(points) if i >= first
    ]
    if first < len(points):
        nodes += [
            (each.point.arclength, Node(-1 - i, each.orbit, _label(each, kind)))
            for i, each in enumerate(special_points)
            if each.point.arclength >= begin
        ]
    return [node for _, node in sorted(nodes, key=lambda placed: placed[0])]


def _label(each: BranchPoint | SpecialPoint | LocusPoint | Codim2Point, kind: Kind | None) -> int:
    """Return the label of the line from a point on: the stability of its motions, or the kind of a locus."""
    if isinstance(each, BranchPoint):
        return _STABILITY.index(each.instability.label)
    if isinstance(each, SpecialPoint):
        return _STABILITY.index(each.after.label)
    assert kind is not None  # these lie on loci
    return labels().index(kind.value)


def special_words(line: Line) -> list[dict[str, Any]]:
    """Describe the special points of a line for the page: symbols, lines of text, and what can begin there.

    Points at one place have one description. Those after the first are marked: the page draws only that.
    """
    names, every = (line.parameter, line.second), line.special_points
    if line.kind is not None:
        return [_words_of_codim2(each, names) for each in every if isinstance(each, Codim2Point)]
    groups = at_once([each for each in every if isinstance(each, SpecialPoint)])
    return [_words_of(group) | {"again": each is not group[0]} for group in groups for each in group]


def _words_of_codim2(special: Codim2Point, names: tuple[str, str]) -> dict[str, Any]:
    units, style = special.orbit.system.units, CODIM2[special.kind]
    own = [units.parameter(name) if units else "" for name in names]
    at = (f"{value:.9g} {unit}".rstrip() for value, unit in zip(special.values, own, strict=True))
    lines = [f"at {', '.join(at)}", special.contact]
    return {"kind": f"codim2 {special.kind.value}", "text": style.legend, "label": style.label, "lines": lines}


def _words_of(group: Sequence[SpecialPoint]) -> dict[str, Any]:
    special, words = group[0], words_of(group)
    units, style, kind = special.orbit.system.units, symbol_style(special.kind), special.kind
    unit = units.parameter(special.parameter) if units else ""
    at = f"at {' ± '.join(filter(None, (words['at'], words['±'])))} {unit}".rstrip()
    many = words["kind"] if special.multiplicity > 1 else ""
    return {
        "kind": kind.value,
        "text": style.text,
        "label": style.label,
        "value": special.value,
        "lines": [at, *(words[name] for name in ("stability", "criticality", "contact")), many],
        "has_locus": not kind.no_locus and special.multiplicity == 1,
        "switches": special.ways > 0,
    }


def finite(value: float) -> float | None:
    """Return a number, or None for one that JSON cannot hold."""
    return value if math.isfinite(value) else None


def _packed(values: Sequence[float], kind: str) -> str:
    return base64.b64encode(np.array(values, dtype=kind).tobytes()).decode("ascii")
