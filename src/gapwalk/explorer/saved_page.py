"""Saved page: a result as one HTML file that opens in any browser, without a network.

The file holds the text, style and modules of the explorer's page, Plotly, curves over all quantities that can be
chosen, and the motions of many of their points. Arrays are one run of bytes that compresses well.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from gapwalk.answers.design import Design
from gapwalk.answers.rattle_bands import RattleBands
from gapwalk.answers.rattle_map import RattleMap
from gapwalk.answers.run_up import RunUp
from gapwalk.answers.run_ups import RunUps
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.answers.threshold import Threshold
from gapwalk.answers.tolerance import Tolerance
from gapwalk.attractors.attractor import Settled
from gapwalk.attractors.basins import Basins, BasinShares
from gapwalk.attractors.regimes import Regimes
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.loci import Codim2Point, Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.explorer.answer_view import Alone, AnswerView, has_picture, view_of
from gapwalk.explorer.axis_quantities import measure_name, quantity, quantity_words
from gapwalk.explorer.curve_data import (
    Node,
    locus_lines,
    nodes_of,
    special_words,
)
from gapwalk.explorer.exploration import Line, answer_lines, line_of
from gapwalk.explorer.friction_panels import energy_table
from gapwalk.explorer.gradient_panel import gradient_of
from gapwalk.explorer.html_file import Blob, html_file
from gapwalk.explorer.motion_panels import lines_and_section, panels_of, scenes_of
from gapwalk.explorer.next_view import neighbours, stretches
from gapwalk.explorer.result_titles import verdict
from gapwalk.explorer.run_up_view import RunUpView
from gapwalk.explorer.what_next import at_special
from gapwalk.flow.motion import force_of
from gapwalk.free.backbone_record import Backbone
from gapwalk.free.backbones import Backbones
from gapwalk.free.self_excitation import SelfExcited
from gapwalk.model.system import System
from gapwalk.model.words import full_measure, signal_words
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.export import write_whole
from gapwalk.studies.family import Family
from gapwalk.studies.map import Map
from gapwalk.studies.result import Result
from gapwalk.studies.settle_study import SettleFinding
from gapwalk.studies.sweep import Sweep
from gapwalk.studies.sweep_study import SweepFinding
from gapwalk.tori.tongue import Tongue
from gapwalk.tori.torus import Torus
from gapwalk.tori.torus_diagram import TorusDiagram
from gapwalk.tori.torus_family import TorusFamily

Found = (
    Result
    | Branch
    | Diagram
    | Family
    | Settled
    | Orbit
    | RattleBands
    | RattleMap
    | Threshold
    | Design
    | Tolerance
    | RunUp
    | RunUps
    | Basins
    | BasinShares
    | Regimes
    | Locus
    | Map
    | Sweep
    | TorusDiagram
    | TorusFamily
    | Torus
    | Tongue
    | Backbones
    | Backbone
    | SelfExcited
)
"""Records that can be saved."""


class Lines(NamedTuple):
    """Lines of the page, the parameters that differ among them, and axes; or a motion; or an answer."""

    named: tuple[Line, ...]
    parameters: tuple[str, ...] = ()
    motion: Orbit | Settled | None = None
    answer: AnswerView | None = None
    axes: tuple[str, str] | None = None
    verdict: str = ""

    @property
    def system(self) -> System:
        """The system."""
        if self.motion is not None:
            return self.motion.system
        return self.answer.system if self.answer is not None else self.named[0].points[0].orbit.system


def lines_of(found: Found) -> Lines:
    """Return the branches, the motion or the answer of a record."""
    match found:
        case Branch():
            return _along([(f"P{found.period}-1", found)])
        case Diagram():
            return _along((member.name, member.branch) for member in found.members)
        case Settled() | Orbit():
            return Lines((), (), found)
        case Locus():
            return _in_plane([(f"{found.kind.value}-1", found)], found.first, found.second)
        case Map():
            sections = [(f"P{each.period}-{number}", each) for number, each in enumerate(found.branches, start=1)]
            return _in_plane([*sections, *zip(found.names, found.loci, strict=True)], found.first, found.second)
        case Sweep():
            return _answered(view_of(SweepFinding(found)))
        case Result(finding=None, map=None):
            return _along(found.named)
        case Result(finding=None, map=chart) if chart is not None and chart.loci:
            return lines_of(chart)
        case Result(finding=SettleFinding() as finding):
            return lines_of(finding.settled)._replace(verdict=verdict(finding.settled, finding))
        case Result(finding=finding) if finding is not None and has_picture(finding.record):
            return _answered(view_of(finding))
    if has_picture(found):
        return _answered(view_of(Alone(found)))
    kind = found.options.kind if isinstance(found, Result) else type(found).__name__
    raise ModelError(
        f"an HTML file shows branches, their motions and answers, and a {kind} has none; write --format svg, pdf or "
        "png (in Python: gapwalk.plot.save)"
    )


def _along(named: Iterable[tuple[str, Branch]]) -> Lines:
    lines = tuple(line_of(name, branch, (0.0, 0.0)) for name, branch in named)
    if not lines:
        raise ModelError("there are no branches yet, so there is nothing to show")
    return Lines(lines, tuple(dict.fromkeys(line.parameter for line in lines)))


def _in_plane(named: Iterable[tuple[str, Branch | Locus]], first: str, second: str) -> Lines:
    """Return loci over both parameters, and the branches on which they begin."""
    lines = tuple(line_of(name, locus, (0.0, 0.0)) for name, locus in named)
    if not lines:
        raise ModelError("there are no loci yet, so there is nothing to show")
    return Lines(lines, (first, second), axes=(first, second))


def _answered(view: AnswerView) -> Lines:
    lines, system = answer_lines(view), view.system
    names = [name for line in lines for name in (line.parameter, line.second) if name]
    names = [*(name for name in view.axes or () if name in system.parameters), *names, *view.parameters]
    return Lines(tuple(lines), tuple(dict.fromkeys(names)), None, view)


_SAMPLES = 512  # of a motion, at most
_COORDINATES = 6  # with measures to choose from
_MAPS = 4  # signals of a run-up whose order maps are stored
_SOUND, _RATE, _LOWEST_RATE = 600_000, 24_000, 8_000  # samples of a stored sound, at most; in a second
_MEASURES = ("half", "max", "min")
_LEFT_OUT = ("parameters", "others")  # of the panels: only a page with a server uses them


def content_of(
    lines: Lines, measure: str, title: str, most: int, blob: Blob, most_gradients: int = 20
) -> dict[str, Any]:
    """Return the content of the page as a JSON value; its arrays go into a blob."""
    system = lines.system
    measure = full_measure(measure, system.coordinates)
    nodes = [nodes_of(line.points, line.special_points, 0, line.kind) for line in lines.named]
    stride = max(1, -(-sum(len(line.points) for line in lines.named) // max(most, 1)))
    kept = [_chosen(each, stride) for each in nodes]
    names = quantities(lines, system, measure)
    x, y = names[0], measure_name(measure, system)
    if lines.axes is not None:
        x, y = lines.axes
    answer = None if lines.answer is None else lines.answer.content()
    pictures = [] if lines.answer is None else [each.content() for each in lines.answer.pictures()]
    if answer is not None and answer["axes"]:
        x, y = answer["axes"]
        layers = [name for layer in answer.get("layers", ()) for name in layer["axes"]]
        names = list(dict.fromkeys((x, y, *(names if lines.named else layers))))
    signal = (measure if y in system.parameters else y).partition(".")[2].rstrip("'")
    signal = signal if signal in system.coordinates else system.coordinates[0]
    gradients = _gradients(lines, (answer or {}).get("ends", ()), most_gradients)
    return {
        "title": title,
        "x": x,
        "y": y,
        "signal": signal,
        "signals": [[name, signal_words(name, system.units)] for name in _signals(system)],
        "quantities": quantity_words(names, system),
        "parameters": [name for name in names if name in system.parameters],
        "note": _note(nodes, kept),
        "machine": scenes_of(system),
        "verdict": lines.verdict,
        "loci": locus_lines() if any(line.kind is not None for line in lines.named) else [],
        "answer": blob.packed(answer),
        "pictures": pictures,
        "heard": _heard(lines.answer, answer, blob) if answer and isinstance(lines.answer, RunUpView) else None,
        "branches": [
            {
                "name": line.name,
                "period": line.period,
                "count": len(line.points),
                "second": line.second,
                "earlier": line.is_earlier,
                "quantities": {each: _stored(found, each, blob) for each in names},
                "node": blob.exact([node.number for node in found], "i4"),
                "label": blob.exact([node.label for node in found], "u1"),
                "special": special_words(line),
                "next": [_next(each, line, lines.named, measure) for each in line.special_points],
                "gradients": {
                    str(index): gradients[id(each)]
                    for index, each in enumerate(line.special_points)
                    if id(each) in gradients
                },
                "motions": {
                    str(node.number): _motion(node.orbit, signal, blob)
                    for place, node in enumerate(found)
                    if place in places
                },
            }
            for line, found, places in zip(lines.named, nodes, kept, strict=True)
        ],
        "motion": None if lines.motion is None else _motion(lines.motion, signal, blob),
    }


def _heard(view: RunUpView, answer: dict[str, Any], blob: Blob) -> dict[str, Any]:
    """Return the order maps of the first signals of a run-up, and the sound of the first; leave others out."""
    kept = answer["heard"]["signals"][:_MAPS]
    answer["heard"]["signals"] = kept
    seconds = answer["heard"]["seconds"][-1]
    rate = int(min(_RATE, max(_LOWEST_RATE, _SOUND / seconds)))
    sound = None
    if seconds * rate <= _SOUND:
        found = view.sound(kept[0][0], rate)
        scale = found.peak / 32767.0 or 1.0
        levels = np.rint((found.values - found.values.mean()) / scale)
        sound = {"of": kept[0][0], "rate": rate, "scale": scale, "levels": blob.exact(levels, "i2")}
    return {"maps": {name: view.heard(name) for name, _ in kept}, "sound": sound}


def _next(special: SpecialPoint | Codim2Point, line: Line, named: Sequence[Line], measure: str) -> str:
    """Return the meaning of a special point for the machine; empty for points of codimension two."""
    if not isinstance(special, SpecialPoint):
        return ""
    near = stretches(named, special, special.orbit.system)
    return at_special(special, measure, near, neighbours(line, special))["text"]


def _gradients(lines: Lines, ends: Iterable[dict[str, Any]], most: int) -> dict[int, dict[str, Any]]:
    """Return the gradients of special points, by the identity of each: first those that an answer names."""
    named = [lines.named[end["branch"]].special_points[end["special"]] for end in ends if "branch" in end]
    points = [*named, *(each for line in lines.named for each in line.special_points)]
    moved = {id(each): each for each in points if isinstance(each, SpecialPoint) and not each.kind.no_locus}
    return {key: gradient_of(each) for key, each in list(moved.items())[:most]}


def quantities(lines: Lines, system: System, measure: str) -> list[str]:
    """Return the quantities that can be chosen for the axes: varied parameters, and measures."""
    names = [f"{kind}.{each}" for each in system.coordinates[:_COORDINATES] for kind in _MEASURES]
    return list(dict.fromkeys((*lines.parameters, *(measure_name(each, system) for each in (measure, *names)))))


def _chosen(nodes: Sequence[Node], stride: int) -> set[int]:
    """Return the indices of the nodes whose motions are stored: special points, ends, and every n-th point."""
    return {
        place
        for place, node in enumerate(nodes)
        if node.number < 0 or node.number % stride == 0 or place == len(nodes) - 1
    }


def _stored(nodes: Sequence[Node], name: str, blob: Blob) -> dict[str, Any]:
    """Store a quantity: a parameter in double precision, because zooming in on it must not show steps."""
    is_parameter = name in nodes[0].orbit.system.parameters
    return blob.exact([quantity(node.orbit, name) for node in nodes], "f8" if is_parameter else "f4")


def _motion(motion: Orbit | Settled, signal: str, blob: Blob) -> dict[str, Any]:
    panels = panels_of(motion, signal, _SAMPLES) | {"energy": energy_table(motion)}
    panels["machine"].pop("scenes")  # they are in the file once
    panels["details"] = lines_and_section(motion, signal)
    return blob.packed({name: value for name, value in panels.items() if name not in _LEFT_OUT})


def _signals(system: System) -> list[str]:
    names = [f"{each}{dashes}" for each in system.coordinates[:_COORDINATES] for dashes in ("", "'", "''")]
    return [*names, *map(force_of, system.structure.contacts[:_COORDINATES])]


def _note(nodes: Sequence[Sequence[Node]], kept: Sequence[set[int]]) -> str:
    """Return a sentence on the number of points with stored motions; empty if all have them."""
    there, total = sum(map(len, kept)), sum(map(len, nodes))
    if there == total:
        return ""
    return f"{there} of {total} points have their motions in this file; the nearest of them is shown."


def save_html(
    found: Found,
    path: str | os.PathLike[str],
    *,
    measure: str | None = None,
    title: str | None = None,
    motions: int = 400,
    gradients: int = 20,
) -> None:
    """Save a result as one HTML file with clickable points, which opens in any browser, without a network.

    The diagram zooms, its axes can be chosen, and a click on a point (or the arrow keys) shows its motion: moving
    parts, history, phase portrait, force-deflection loop, spectrum, section, multipliers, contact log, and its sound.

    Parameters
    ----------
    found
        A result of branches, a branch, a diagram, a family, a settled motion, an orbit; or an answer: rattle bands or a
        map of rattle, a threshold, a design, a tolerance, one run-up or many; a locus, a map of loci, a sweep, basins
        of attraction or their shares, a map of regimes; tori, a family of them, one torus or a tongue; backbones;
        self-excited motions.
    path
        The file to write.
    measure
        Measure that the diagram shows first, as in `Branch.plot`; by default that of the study.
    title
        Title of the page; by default that of the study.
    motions
        Largest number of points of the branches whose motions are stored; about 2 kB each for two coordinates. Of
        more points every second (third, ...) is stored. All special points have their motions in addition.
    gradients
        Largest number of special points of which the file also says what moves them most.

    Raises
    ------
    ModelError
        If the record has no branches, no motion and no answer, or there is no such measure.
    StoreError
        If the file cannot be written.

    Examples
    --------
    >>> gw.save_html(branch, "stop.html")
    """
    if motions < 1:
        raise ModelError(f"motions is {motions}; it must be at least 1, as in motions=400")
    if gradients < 0:
        raise ModelError(f"gradients is {gradients}; it must be at least 0, as in gradients=20")
    lines, asked = lines_of(found), found
    if isinstance(found, Result):
        asked, title = found.options, found.title if title is None else title
    blob, measure = Blob(), measure or shown_measure(lines.system, asked)
    shown = content_of(lines, measure, title or "A result", motions, blob, gradients)
    write_whole(path, html_file(shown["title"], shown, blob.content))
