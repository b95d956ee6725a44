"""Saved page: a result as one HTML file that opens in any browser, without a network.

The file holds the text, style and modules of the explorer's page, Plotly, curves over all quantities that can be
chosen, and the motions of many of their points. Arrays are one run of bytes that compresses well.
"""

from __future__ import annotations

import base64
import gzip
import html
import json
import os
import re
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Any, NamedTuple
from urllib.parse import quote

import numpy as np
from numpy.typing import ArrayLike
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from gapwalk.answers.band_picture import Stretches
from gapwalk.answers.run_up import RunUp
from gapwalk.answers.shown_measure import shown_measure
from gapwalk.attractors.settle import Settled
from gapwalk.attractors.spectrum import Sound, Tracked
from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.diagram import Diagram
from gapwalk.bifurcation.loci import Codim2Point, Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.errors import ModelError
from gapwalk.explorer.answer_view import AnswerView, HeardRunUp, drawn_on_paper, has_picture
from gapwalk.explorer.diagram_lines import Line, line_of, measure_name, quantity, quantity_words
from gapwalk.explorer.motion_panels import (
    Node,
    energy_table,
    gradient_of,
    lines_and_section,
    locus_lines,
    nodes_of,
    panels_of,
    scenes_of,
    special_words,
)
from gapwalk.explorer.opened_file import answer_lines
from gapwalk.explorer.server_state import Session
from gapwalk.explorer.what_next import at_special, neighbours, stretches
from gapwalk.explorer.workspace_folder import RECORDS, verdict
from gapwalk.flow.motion import force_of
from gapwalk.meanings import page_colors
from gapwalk.measurement.measured_record import is_run_up, read_run_up
from gapwalk.model.measures import full_measure
from gapwalk.model.system import System
from gapwalk.model.words import signal_words
from gapwalk.orbit.orbit import Orbit
from gapwalk.studies.bifurcation_map import Map
from gapwalk.studies.export import write_whole
from gapwalk.studies.result import Result
from gapwalk.studies.settle_study import SettleFinding
from gapwalk.studies.sweep_study import Sweep

# A saved page as one HTML file: text, style and modules of the explorer's page, Plotly, and what the page shows.

_PAGE = files("gapwalk.explorer") / "page"
_ENTRY = "saved.js"
_INSTEAD = {"api.js": "saved_data.js"}  # there is no server: its answers are in the file
_IMPORT = re.compile(r'(\bfrom|\bimport) "\./([\w-]+\.js)"')
_HEAD = re.compile(r"<title>.*?(?=</head>)", re.S)
_ICON = "/static/icon.svg"


def html_file(title: str, shown: Any, numbers: bytes | bytearray) -> bytes:
    """Return the whole file."""
    plotly = (files("plotly") / "package_data" / "plotly.min.js").read_bytes()
    head = [
        f"<title>{html.escape(title)} – gapwalk</title>",
        f'<link rel="icon" href="{_icon()}">',
        f"<style>\n{page_colors()}{_text('style.css').replace(_ICON, _icon())}</style>",
        f'<script type="importmap">{json.dumps({"imports": _modules()})}</script>',
        f'<script type="text/plain" id="plotly">{_zipped(plotly)}</script>',
        f'<script type="text/plain" id="shown">{_zipped(json.dumps(shown).encode())}</script>',
        f'<script type="text/plain" id="numbers">{_zipped(numbers)}</script>',
        f'<script type="module">import "gapwalk/{_ENTRY}";</script>\n',
    ]
    page = _HEAD.sub(lambda _: "\n".join(head), _text("index.html"), count=1)
    return page.replace("<body>", '<body class="saved">', 1).encode()


def _modules() -> dict[str, str]:
    """Return the modules of the page as data URLs, in which they can import others only by bare names."""
    found: dict[str, str] = {}
    left = [_ENTRY]
    while left:
        name = left.pop()
        if f"gapwalk/{name}" in found:
            continue
        text = _text(_INSTEAD.get(name, name))
        left += [other for _, other in _IMPORT.findall(text)]
        found[f"gapwalk/{name}"] = _data("text/javascript", _IMPORT.sub(r'\1 "gapwalk/\2"', text))
    return found


def _icon() -> str:
    return _data("image/svg+xml", _text("icon.svg"))


def _data(kind: str, text: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(text.encode()).decode()}"


def _zipped(content: bytes | bytearray) -> str:
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


def _text(name: str) -> str:
    return (_PAGE / name).read_text(encoding="utf-8")


STEPS = 1 << 14
"""Levels between the least and the greatest value of a drawn array: more than a screen has pixels."""

_SHORTEST = 8  # of a list that is packed


class Blob:
    """Collector of arrays in one run of bytes, which ``page/saved_data.js`` reads."""

    def __init__(self) -> None:
        self.content = bytearray()

    def exact(self, values: ArrayLike, kind: str) -> dict[str, Any]:
        """Store an array as it is; `kind` is its little-endian dtype: ``f8``, ``f4``, ``i4``, ``i2`` or ``u1``."""
        array = np.asarray(values, dtype=f"<{kind}")
        return {"kind": kind, "at": self._take(array.tobytes(), array.itemsize), "n": len(array)}

    def drawn(self, values: ArrayLike) -> dict[str, Any]:
        """Store a curve in `STEPS` levels, as fine as a screen: their second differences, low bytes first."""
        array = np.asarray(values, dtype=float)
        low, high = float(array.min()), float(array.max())
        levels = np.rint((array - low) * ((STEPS - 1) / ((high - low) or 1.0))).astype(np.int64)
        steps = np.diff(np.diff(levels, prepend=0), prepend=0).astype(np.uint16)  # modulo 2**16: nothing is lost
        content = (steps & 0xFF).astype(np.uint8).tobytes() + (steps >> 8).astype(np.uint8).tobytes()
        return {"kind": "drawn", "at": self._take(content, 1), "n": len(array), "low": low, "high": high}

    def packed(self, plain: Any) -> Any:
        """Return a JSON value with its long lists of numbers stored as curves."""
        if isinstance(plain, dict):
            return {key: self.packed(value) for key, value in plain.items()}
        if isinstance(plain, list):
            if len(plain) >= _SHORTEST and all(isinstance(each, float) for each in plain):
                return self.drawn(plain)
            return [self.packed(each) for each in plain]
        return plain

    def _take(self, content: bytes, size: int) -> int:
        """Append bytes, and return their place, a multiple of the size of an element."""
        self.content += b"\0" * (-len(self.content) % size)
        at = len(self.content)
        self.content += content
        return at


# Requests of the page about what is heard: order maps of a run-up, its sound, and measured records to lay over it.

_LISTED = 100  # records
_NAME = 300  # longest text of a request


class HeardRequests:
    """Handlers of these requests."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def routes(self) -> list[Route]:
        """Return their addresses."""
        return [
            Route("/api/heard", self.heard),
            Route("/api/sound", self.sound),
            Route("/api/wav", self.wav),
            Route("/api/records", self.records),
        ]

    async def heard(self, request: Request) -> Response:
        """Return the order maps of a signal of a run-up, with a measured record if one is named."""
        view, signal, name = self._view(request), _field(request, "signal"), _field(request, "record")
        return JSONResponse(await self.session.flows.do(lambda: self._heard(view, signal, name)))

    def _heard(self, view: HeardRunUp, signal: str, name: str) -> dict[str, Any]:
        record: Tracked | None = None
        if name:
            path = self.session.workspace.path(name, RECORDS)
            record = read_run_up(path, view.record.system, signal)
        return view.heard(signal, record, name)

    async def sound(self, request: Request) -> Response:
        """Return the samples of a run-up in the unit of the signal, as little-endian numbers of 32 bits."""
        found = await self._sound(request)
        content = found.values.astype("<f4").tobytes()
        return Response(content, media_type="application/octet-stream", headers={"x-rate": str(found.rate)})

    async def wav(self, request: Request) -> Response:
        """Return the sound of a run-up as a WAV file."""
        found, scale = await self._sound(request), _field(request, "scale")
        try:
            full_scale = float(scale) if scale else None
        except ValueError:
            raise ModelError(f"scale is {scale[:20]!r}; it must be a number, as in 500") from None
        content = found.wav(full_scale)
        result = _field(request, "result") or os.path.splitext(_field(request, "file"))[0]
        name = quote(f"{result}-{found.signal}.wav".replace("'", "-dot").replace("/", "-"), errors="replace")
        return Response(
            content, media_type="audio/wav", headers={"content-disposition": f"attachment; filename*=utf-8''{name}"}
        )

    async def records(self, request: Request) -> Response:
        """Return the names of the files in the folder that have channels of time and of the speed."""
        study = self.session.exploration(_field(request, "file")).described()
        system = None if study is None else study.system
        names = [] if system is None else await self.session.flows.do(lambda: self._run_ups(system))
        return JSONResponse({"records": names[:_LISTED]})

    def _run_ups(self, system: System) -> list[str]:
        folder = self.session.workspace
        return [name for name in folder.records() if is_run_up(folder.path(name, RECORDS), system)]

    async def _sound(self, request: Request) -> Sound:
        view, signal = self._view(request), _field(request, "signal")
        return await self.session.flows.do(lambda: view.sound(signal))

    def _view(self, request: Request) -> HeardRunUp:
        entry = self.session.exploration(_field(request, "file")).entry(_field(request, "result"))
        if entry.answer is None or not isinstance(entry.answer.record, RunUp):
            raise ModelError(f"{entry.title} is no run-up; only run-ups have a sound over the speed")
        return HeardRunUp(entry.answer)


def _field(request: Request, name: str) -> str:
    text = request.query_params.get(name, "")
    if len(text) > _NAME:
        raise ModelError(f"{name} is longer than {_NAME} letters")
    return text


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


def lines_of(found: Any) -> Lines:
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
            return _answered(AnswerView(found))
        case Result(finding=None, map=None):
            if any(branch.bands for branch in found.branches):
                return _answered(AnswerView(Stretches(found.branches, shown_measure(found.system, found.walked))))
            return _along(found.named)
        case Result(finding=None, map=chart) if chart is not None and chart.loci:
            return lines_of(chart)
        case Result(finding=SettleFinding() as finding):
            return lines_of(finding.settled)._replace(verdict=verdict(finding.settled, finding))
        case Result(finding=finding) if finding is not None and has_picture(finding.record):
            return _answered(AnswerView(finding))
    if has_picture(found):
        return _answered(AnswerView(found))
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
    names = [*(name for name in view.axes or () if name in system.parameters), *names, *view.picture.parameters]
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
    pictures = [] if lines.answer is None else [drawn_on_paper(each) for each in lines.answer.picture.wholes]
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
        "heard": _heard(lines.answer, answer, blob) if answer is not None and "heard" in answer else None,
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


def _heard(view: AnswerView | None, answer: dict[str, Any], blob: Blob) -> dict[str, Any]:
    """Return the order maps of the first signals of a run-up, and the sound of the first; leave others out."""
    assert view is not None
    run_up = HeardRunUp(view)
    kept = answer["heard"]["signals"][:_MAPS]
    answer["heard"]["signals"] = kept
    seconds = answer["heard"]["seconds"][-1]
    rate = int(min(_RATE, max(_LOWEST_RATE, _SOUND / seconds)))
    sound = None
    if seconds * rate <= _SOUND:
        found = run_up.sound(kept[0][0], rate)
        scale = found.peak / 32767.0 or 1.0
        levels = np.rint((found.values - found.values.mean()) / scale)
        sound = {"of": kept[0][0], "rate": rate, "scale": scale, "levels": blob.exact(levels, "i2")}
    return {"maps": {name: run_up.heard(name) for name, _ in kept}, "sound": sound}


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
    found: Any,
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
        Branches: a result that has them, a branch, a diagram, a family. Motions: an orbit, a settled motion, tori, one
        torus, a family of tori, a tongue, backbones, self-excited motions. Answers: rattle bands or a map of rattle, a
        threshold, a design, a tolerance, one run-up or many, a locus, a map of loci, a sweep, basins of attraction or
        their shares, a map of regimes.
    path
        The file to write.
    measure
        Measure that the diagram shows first, as in `Branch.plot`; by default that of the study.
    title
        Title of the page; by default that of the study.
    motions
        Largest number of points of branches whose motions the file holds, about 2 kB each for two coordinates. If there
        are more points, it holds the motion of every second (third, ...) one, and those of all special points.
    gradients
        Largest number of special points for which the file also lists the parameters that move them most.

    Raises
    ------
    ModelError
        If `found` has no branches, no motion and no answer, or there is no such measure.
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
