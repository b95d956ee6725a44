"""What a kept page shows: curves over all quantities that can be chosen, and the motions of many of their points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gapwalk.attractors.settled import Settled
from gapwalk.explorer.curve_data import MEASURE, Node, measure_name, nodes_of, quantity, special_words
from gapwalk.explorer.panels import panels_of
from gapwalk.explorer.saved.blob import Blob
from gapwalk.explorer.saved.saved_branches import Lines
from gapwalk.flow.motion import force_of
from gapwalk.model.system import System
from gapwalk.orbit.orbit import Orbit
from gapwalk.plot.words import full_measure, measure_words, parameter_words

_SAMPLES = 512  # of a motion, at most
_COORDINATES = 6  # whose measures can be chosen
_MEASURES = ("half", "max", "min")
_LEFT_OUT = ("parameters", "seconds", "others")  # of the panels: only a page with a server asks for them


def content_of(lines: Lines, measure: str, title: str, most: int, blob: Blob) -> dict[str, Any]:
    """What is shown, as a JSON value; its arrays go into a blob.

    Parameters
    ----------
    lines
        The branches, or the motion.
    measure
        What the diagram shows first.
    title
        Of the page.
    most
        Points of branches whose motions are kept, at most, besides special points.
    blob
        Takes the arrays.
    """
    system = lines.motion.system if lines.motion else lines.named[0][1].system
    measure = full_measure(measure, system.coordinates)
    nodes = [nodes_of(branch.points, branch.special_points) for _, branch in lines.named]
    stride = max(1, -(-sum(len(branch.points) for _, branch in lines.named) // max(most, 1)))
    kept = [_chosen(each, stride) for each in nodes]
    signal = measure.partition(".")[2].rstrip("'")
    signal = signal if signal in system.coordinates else system.coordinates[0]
    names = quantities(lines, system, measure)
    return {
        "title": title,
        "x": lines.parameters[0] if lines.parameters else names[0],
        "y": measure_name(measure, system),
        "signal": signal,
        "signals": _signals(system),
        "quantities": [{"name": name, "words": _words(name, system)} for name in names],
        "note": _note(nodes, kept),
        "branches": [
            {
                "name": name,
                "period": branch.period,
                "count": len(branch.points),
                "quantities": {each: blob.exact(*_values(found, each, system)) for each in names},
                "node": blob.exact([node.number for node in found], "i4"),
                "label": blob.exact([node.label for node in found], "u1"),
                "special": [special_words(each) for each in branch.special_points],
                "motions": {
                    str(node.number): _motion(node.orbit, signal, blob)
                    for place, node in enumerate(found)
                    if place in places
                },
            }
            for (name, branch), found, places in zip(lines.named, nodes, kept, strict=True)
        ],
        "motion": None if lines.motion is None else _motion(lines.motion, signal, blob),
    }


def quantities(lines: Lines, system: System, measure: str) -> list[str]:
    """Names of what can be chosen for the axes: what differs, and measures of one survey of each motion."""
    names = [f"{kind}.{each}" for each in system.coordinates[:_COORDINATES] for kind in _MEASURES]
    return list(dict.fromkeys((*lines.parameters, *(measure_name(each, system) for each in (measure, *names)))))


def _chosen(nodes: Sequence[Node], stride: int) -> set[int]:
    """The places of the nodes whose motions are kept: special points, ends, and every so many points."""
    return {
        place
        for place, node in enumerate(nodes)
        if node.number < 0 or node.number % stride == 0 or place == len(nodes) - 1
    }


def _values(nodes: Sequence[Node], name: str, system: System) -> tuple[np.ndarray, str]:
    """Of a quantity, and how exactly they are kept: zooming in on a parameter must not show steps."""
    return np.array([quantity(node.orbit, name) for node in nodes]), "f8" if name in system.parameters else "f4"


def _motion(motion: Orbit | Settled, signal: str, blob: Blob) -> dict[str, Any]:
    panels = panels_of(motion, signal, _SAMPLES)
    return blob.packed({name: value for name, value in panels.items() if name not in _LEFT_OUT})


def _signals(system: System) -> list[str]:
    names = [f"{each}{dashes}" for each in system.coordinates[:_COORDINATES] for dashes in ("", "'", "''")]
    return [*names, *map(force_of, system.structure.contacts[:_COORDINATES])]


def _words(name: str, system: System) -> str:
    units = system.units
    if name in system.parameters:
        return parameter_words(name, units)
    return measure_words(name.removeprefix(MEASURE), units)


def _note(nodes: Sequence[Sequence[Node]], kept: Sequence[set[int]]) -> str:
    """How many points have their motions in the file, in a sentence; empty where all have."""
    there, total = sum(map(len, kept)), sum(map(len, nodes))
    if there == total:
        return ""
    return f"{there} of {total} points have their motions in this file; the nearest of them is shown."
