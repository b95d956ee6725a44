"""A branch as arrays for the page: any quantity over any other, stability, and special points."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gapwalk.continuation.branch import SpecialPoint
from gapwalk.continuation.point import BranchPoint
from gapwalk.orbit.measures import MEASURES
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.style import SYMBOLS

LABELS = ("stable", "below", "above", "pair")
"""Kinds of stability (see `Instability.label`) by the numbers that stand for them."""


class Node(NamedTuple):
    """A place on a branch: the number of a point, or -1 - the number of a special point; what follows it (`LABELS`)."""

    number: int
    orbit: Orbit
    label: int


def quantity(orbit: Orbit, name: str) -> float:
    """A parameter of an orbit's system, or a measure of the orbit, by name."""
    return orbit.system[name] if name in orbit.system.parameters else orbit.measure(name)


def is_at_hand(points: Sequence[BranchPoint], special_points: Sequence[SpecialPoint], name: str) -> bool:
    """Whether a quantity of all points is known without an integration, so that it need not wait for a flow."""
    kind, _, signal = name.partition(".")
    orbits = [point.orbit for point in points] + [special.orbit for special in special_points]
    if not orbits or name in orbits[0].system.parameters:
        return True
    known = kind in MEASURES and signal in orbits[0].system.coordinates
    return known and all("extremes" in vars(orbit) for orbit in orbits)


def curve_of(
    points: Sequence[BranchPoint], special_points: Sequence[SpecialPoint], x: str, y: str, first: int = 0
) -> dict[str, Any]:
    """The points and special points of a branch in the order of the walk.

    Parameters
    ----------
    points, special_points
        Of the branch.
    x, y
        Names of parameters or measures.
    first
        The first point that is wanted: a branch that grows is asked for its new points only.

    Returns
    -------
    dict
        ``x``, ``y`` (float64), ``node`` (int32: the number of a point, or -1 - the number of a special point), and
        ``label`` (uint8: the place in `LABELS` of what follows), each in base64, little-endian; ``count``, the points
        of the branch; and ``special``, all its special points.
    """
    nodes = nodes_of(points, special_points, first)
    return {
        "count": len(points),
        "x": _packed([quantity(node.orbit, x) for node in nodes], "<f8"),
        "y": _packed([quantity(node.orbit, y) for node in nodes], "<f8"),
        "node": _packed([node.number for node in nodes], "<i4"),
        "label": _packed([node.label for node in nodes], "u1"),
        "special": [
            {**special_words(each), "x": quantity(each.orbit, x), "y": quantity(each.orbit, y)}
            for each in special_points
        ],
    }


def nodes_of(points: Sequence[BranchPoint], special_points: Sequence[SpecialPoint], first: int = 0) -> list[Node]:
    """The points and special points of a branch in the order of the walk, from the point numbered `first` on."""
    begin = points[first].arclength if first and first < len(points) else -np.inf
    nodes = [
        (point.arclength, Node(i, point.orbit, LABELS.index(point.instability.label)))
        for i, point in enumerate(points)
        if i >= first
    ]
    if first < len(points):
        nodes += [
            (each.point.arclength, Node(-1 - i, each.orbit, LABELS.index(each.after.label)))
            for i, each in enumerate(special_points)
            if each.point.arclength >= begin
        ]
    return [node for _, node in sorted(nodes, key=lambda placed: placed[0])]


def special_words(special: SpecialPoint) -> dict[str, Any]:
    """What a page says of a special point."""
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
    }


def _packed(values: Sequence[float], kind: str) -> str:
    return base64.b64encode(np.array(values, dtype=kind).tobytes()).decode("ascii")
