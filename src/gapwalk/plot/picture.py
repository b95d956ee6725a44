"""Pictures of all records: a registry of drawing functions by type; on screen, in given axes, or in files."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gapwalk.errors import ModelError
from gapwalk.plot.sheet import (
    WIDE,
    AnyFigure,
    Inches,
    close_window,
    lay_out,
    new_sheet,
    open_window,
    sheet_bytes,
    write_heading,
)
from gapwalk.plot.style import SizeName, in_style, sized
from gapwalk.studies.export import write_whole
from gapwalk.studies.result import Result

Finish = Callable[[], None] | None
"""Function that draws what needs the final layout (labels, close-ups); None if there is nothing."""

Draw = TypeVar("Draw", bound=Callable[..., Any])

FORMS = ("png", "svg", "pdf")
"""File formats and their file extensions."""

# Modules of this package that draw the types of gapwalk, imported when such a record is first drawn.
_MODULES = {
    "branches": ("Branch",),
    "cells": ("Basins", "Regimes", "Sweep"),
    "comparisons": ("Alignment", "Contrast", "Fit", "ResultComparison"),
    "diagrams": ("Diagram",),
    "run_up_pictures": ("RunUp", "RunUps"),
    "designs": ("Design",),
    "slip_pictures": ("Energy", "StickSlip"),
    "loci": ("Family", "Map"),
    "tolerances": ("Tolerance",),
    "models": ("System",),
    "rattle_picture": ("RattleBands", "RattleMap"),
    "threshold_picture": ("Threshold",),
    "scan_picture": ("Scan",),
    "backbone_pictures": ("Backbone", "Backbones"),
    "foretold_picture": ("Foretold",),
    "self_excited_pictures": ("Rests", "SelfExcited"),
    "tongue_pictures": ("Tongue",),
    "torus_pictures": ("Torus", "TorusDiagram", "TorusFamily"),
    "motions": (
        *("Attractor", "Hysteresis", "Modes", "Motion", "Orbit"),
        *("Section", "Settled", "Spectrum", "Waterfall"),
    ),
}
_postponed: ContextVar[list[Callable[[], None]] | None] = ContextVar("gapwalk_postponed", default=None)
_HOMES = {kind: module for module, kinds in _MODULES.items() for kind in kinds}


@dataclass(frozen=True)
class Drawing:
    """The drawing of records of one type: in one axes, or in the panels of a figure."""

    #: Called with the record, the axes or figure, and the options of the picture. It may return a function that draws
    #: labels and close-ups; this is called when the layout of the whole sheet is final.
    draw: Callable[..., Finish]
    #: Size of a sheet, in inches; or a function of the record and the options that returns it.
    size: Inches | Callable[..., Inches] = WIDE
    shows: str = ""  #: Quantity that it shows instead of a measure, in words.
    alone: Mapping[str, Any] = field(default_factory=dict)  #: Default options on a separate sheet.
    several: bool = False  #: True if it also accepts a list of records.

    @cached_property
    def options(self) -> tuple[str, ...]:
        """Names of its options."""
        return tuple(inspect.signature(self.draw).parameters)[2:]

    @cached_property
    def by_position(self) -> tuple[str, ...]:
        """Names of the options that may be given by position; the last one is the title."""
        parameters = [*inspect.signature(self.draw).parameters.values()][2:]
        return (*(each.name for each in parameters if each.kind is each.POSITIONAL_OR_KEYWORD), "title")

    def named(self, arguments: tuple[Any, ...], options: Mapping[str, Any], record: Any) -> dict[str, Any]:
        """Collect all options by name; raise a TypeError that lists the options if one does not exist."""
        kind = type(record).__name__
        found = dict(zip(self.by_position, arguments, strict=False)) | dict(options)
        if found.get("measure") is not None and "measure" not in self.options:
            shows = f" {self.shows}, and" if self.shows else ""
            raise ModelError(f"the picture of {kind.lower()} shows{shows} no measure; leave it out")
        wrong = [name for name in found if name not in (*self.options, "title") and found[name] is not None]
        if wrong or len(arguments) > len(self.by_position):
            given = f"not {wrong[0]!r}" if wrong else f"not {len(arguments)} values"
            raise TypeError(f"the picture of {kind} takes {', '.join(self.options) or 'no options'}; {given}")
        return {name: value for name, value in found.items() if value is not None}

    def sheet(self, record: Any, options: Mapping[str, Any]) -> Inches:
        """Return the size of its sheet."""
        return self.size(record, **options) if callable(self.size) else self.size


_IN_AXES: dict[type, Drawing] = {}
_IN_PANELS: dict[type, Drawing] = {}


def draws(
    *kinds: type,
    panels: bool = False,
    size: Inches | Callable[..., Inches] = WIDE,
    shows: str = "",
    alone: Mapping[str, Any] | None = None,
    several: bool = False,
) -> Callable[[Draw], Draw]:
    """Register a function that draws records of given types.

    Parameters
    ----------
    *kinds
        The types.
    panels
        True if it is called with a figure and creates panels in it; otherwise it is called with axes. A type may have
        both: the axes are used for a card, or for a panel in another figure.
    size, shows, alone, several
        As in `Drawing`.

    Returns
    -------
    decorator
        It returns the function itself.

    Examples
    --------
    >>> import dataclasses
    >>> @dataclasses.dataclass
    ... class Ramp:
    ...     height: list
    >>> @gw.plot.draws(Ramp)
    ... def draw_ramp(ramp, ax, *, color="k"):
    ...     ax.plot(ramp.height, color=color)
    >>> gw.plot.save(Ramp([0.0, 1.0]), "ramp.png")  # a record of your own is drawn and saved like all others
    """

    def register(draw: Draw) -> Draw:
        for kind in kinds:
            (_IN_PANELS if panels else _IN_AXES)[kind] = Drawing(draw, size, shows, alone or {}, several)
        return draw

    return register


def drawing_of(record: Any, in_axes: bool = False) -> tuple[Drawing, bool]:
    """Find the drawing of a record, and whether it uses one axes; raise a ModelError if there is none."""
    first = record[0] if isinstance(record, (list, tuple)) and record else record
    for kind in type(first).__mro__:
        if kind.__name__ in _HOMES and kind.__module__.startswith("gapwalk."):
            import_module(f"gapwalk.plot.{_HOMES[kind.__name__]}")
        found = _IN_AXES.get(kind) if in_axes else _IN_PANELS.get(kind, _IN_AXES.get(kind))
        if found is not None:
            if first is not record and not (found.several and all(isinstance(each, kind) for each in record)):
                kinds = ", ".join(dict.fromkeys(type(each).__name__ for each in record))
                raise ModelError(f"a list of {kinds} has no picture in common; draw them one by one, with ax=...")
            return found, found is _IN_AXES.get(kind)
        if kind in _IN_PANELS:
            raise ModelError(f"a {kind.__name__} is drawn in several panels: give figure=..., not ax=...")
    raise ModelError(
        f"there is no picture of a {type(first).__name__}; there are pictures of {', '.join(sorted(_HOMES))}"
    )


def draw(
    record: Any,
    *arguments: Any,
    ax: Axes | None = None,
    figure: AnyFigure | None = None,
    title: str | None = None,
    size: SizeName | None = None,
    **options: Any,
) -> Any:
    """Draw a record: a branch, several of them in a list, a diagram, a motion, a result, ...

    Parameters
    ----------
    record
        The record to draw.
    *arguments, **options
        Options of its picture: see the list below `gapwalk.plot`, or the `plot` of its type.
    ax
        Axes to draw in. For a record with several panels, only the first kind of panel is drawn.
    figure
        A figure, or a part of one, to draw in; by default a new figure of pyplot.
    title
        Plain text above the picture; by default taken from the record.
    size
        Size of a new figure: ``"column"``, ``"page"``, ``"slide"`` or ``"screen"``; see `sized`.

    Returns
    -------
    Axes or Figure
        The axes that contain the picture, or a figure if there are several panels.

    Raises
    ------
    ModelError
        If there is no such picture, measure or size, or nothing to draw yet.
    TypeError
        If the picture has no such option.

    Examples
    --------
    >>> gw.plot.draw(branch, "max.x", size="column").get_xlabel() != ""
    True
    """
    with sized(size):
        return _draw(record, arguments, options, title, open_window, ax, figure)


@contextmanager
def figure(width: float, height: float, title: str = "") -> Iterator[Figure]:
    """Create a figure of several panels in the common style, to be written by `save`.

    `draw` draws into its axes and subfigures, and so may matplotlib. The layout is computed once, at the end of the
    block. The labels of special points and branches are placed only then, because panels change their sizes until then
    and labels would be placed on the curves.

    Parameters
    ----------
    width, height
        Size in inches on a screen; `sized` converts it to that of a column, a page or a slide.
    title
        Title above all panels; it is wrapped.

    Yields
    ------
    Figure
        A figure of matplotlib without pyplot: no window shows it, and it is freed when it has been written.

    Examples
    --------
    >>> with gw.plot.figure(8.0, 8.6, "Two measures") as sheet:
    ...     upper, lower = sheet.subplots(2)
    ...     axes = gw.plot.draw(branch, "max.x", ax=upper), gw.plot.draw(branch, "rms.x", ax=lower)
    >>> gw.plot.save(sheet, "measures.png")
    """
    sheet = new_sheet((width, height))
    token = _postponed.set([])
    try:
        with in_style():
            write_heading(sheet, title)
            yield sheet
            lay_out(sheet)
            for finish in _postponed.get() or ():
                finish()
    finally:
        _postponed.reset(token)


def begin(record: Any, *arguments: Any, ax: Axes, **options: Any) -> Callable[[], None]:
    """Draw a record in one panel of your own figure, except for labels and close-ups.

    Parameters
    ----------
    record, *arguments, ax, **options
        As in `draw`.

    Returns
    -------
    Callable
        Draws the labels and close-ups. Call it when all panels are drawn and laid out, so that a figure of several
        panels is laid out only once.

    Examples
    --------
    >>> sheet = gw.plot.new_sheet()
    >>> finish = gw.plot.begin(branch, "max.x", ax=sheet.subplots())
    >>> finish()
    """
    record, options, _ = unpacked(record, options, None, in_axes=True)
    drawing, _ = drawing_of(record, in_axes=True)
    with in_style():
        finish = drawing.draw(record, ax, **drawing.named(arguments, options, record))
    return in_style()(finish or (lambda: None))


def picture_of(record: Any, *arguments: Any, title: str | None = None, **options: Any) -> Figure:
    """Draw a record on a separate sheet, without pyplot; parameters as in `draw`."""
    return _draw(record, arguments, options, title, new_sheet).figure


def save(
    record: Any,
    *paths: str | os.PathLike[str],
    form: str | None = None,
    title: str | None = None,
    size: SizeName | None = None,
    **options: Any,
) -> None:
    """Draw a record and write it to files.

    Parameters
    ----------
    record
        The record, as in `draw`; or a figure of matplotlib, which is written without changes to its contents.
    *paths
        The files. They end in ``.png``, ``.svg`` or ``.pdf``; in SVG and PDF, lines and text are not rasterised.
    form
        ``"png"``, ``"svg"`` or ``"pdf"`` for other file extensions.
    title, size, **options
        As in `draw`; the title is by default that of the study.

    Raises
    ------
    ModelError
        For another ending, and as in `draw`.
    StoreError
        If a file cannot be written.

    Examples
    --------
    >>> gw.plot.save(branch, "branch.pdf", "branch.svg", measure="max.x", size="column")
    """
    if isinstance(record, Figure) and (title is not None or size is not None or options):
        raise ModelError("a figure has its own measure, title and size; leave them out, or draw it with others")
    forms = [form or Path(path).suffix.lower().removeprefix(".") for path in paths]
    for path, each in zip(paths, forms, strict=True):
        if each not in FORMS:
            raise ModelError(f"{os.fspath(path)} is not a name for a picture; give it the ending .png, .svg or .pdf")
    with sized(size):
        figure = record if isinstance(record, Figure) else picture_of(record, title=title, **options)
        for path, each in zip(paths, forms, strict=True):
            write_whole(path, sheet_bytes(figure, each))


def _draw(
    record: Any,
    arguments: tuple[Any, ...],
    options: dict[str, Any],
    title: str | None,
    make: Callable[[Inches], Figure],
    ax: Axes | None = None,
    figure: AnyFigure | None = None,
) -> Any:
    """Draw a record into axes, a figure, or a new figure of the appropriate size."""
    record, options, title = unpacked(record, options, title, in_axes=ax is not None)
    drawing, in_axes = drawing_of(record, in_axes=ax is not None)
    options = drawing.named(arguments, options, record)
    title = options.pop("title", title)
    if title is not None and "title" in drawing.options:
        options["title"] = title.replace("$", r"\$")
    opened = None
    if ax is None and figure is None:
        options = {**drawing.alone, **options}
        figure = opened = make(drawing.sheet(record, options))
    try:
        with in_style():
            place: Any = ax if ax is not None else figure.add_subplot() if in_axes and figure else figure
            if in_axes and title:
                place.set_title(title.replace("$", r"\$"), wrap=True)
            finish = drawing.draw(record, place, **options)
            postponed = _postponed.get()
            if finish and postponed is not None:
                postponed.append(in_style()(finish))
            elif finish:
                lay_out((place if in_axes else place.axes[0]).get_figure(root=True), keep=True)
                finish()
    except BaseException:
        if opened is not None:
            close_window(opened)  # otherwise pyplot would show an empty window
        raise
    return place


def unpacked(
    record: Any, options: dict[str, Any], title: str | None, in_axes: bool
) -> tuple[Any, dict[str, Any], str | None]:
    """Extract from a result the record to draw, with those options of its study that the picture has too."""
    if not isinstance(record, Result):
        return record, dict(options), title
    finding = record.finding
    if finding is not None and not finding.can_be_drawn:
        raise ModelError(f"there is nothing to draw: {'; '.join(finding.failures) or finding.stored}")
    # an attractor contains more about a settled motion than the record, which is only its last part
    shown = record.diagram or record.map or record.branches if finding is None else finding.record
    shown = getattr(finding, "attractor", shown)
    if isinstance(shown, tuple):
        if not shown:
            raise ModelError("there is nothing to draw: the result has no branches")
        shown = shown[0]
    asked = {each.name: getattr(record.options, each.name) for each in fields(record.options)}
    known = drawing_of(shown, in_axes)[0].options
    asked |= {} if finding is None else dict(finding.drawn)
    decided = {"measure", "signal", "phase", *(() if finding is None else finding.drawn)}
    named = {name: asked[name] for name in asked if name in decided and name in known}
    if options.get("measure") is not None and "measure" not in known:
        raise ModelError(f"the picture of the kind {record.options.kind} shows no measure; leave it out")
    given = {name: value for name, value in options.items() if value is not None}
    return shown, named | given, (record.title or None) if title is None else title
