"""Pictures of all records: a registry of drawing functions by type; on screen, in given axes, or in files."""

from __future__ import annotations

import base64
import html
import inspect
import io
import os
import re
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.textpath import TextToPath

from gapwalk.errors import GapwalkError, ModelError
from gapwalk.notebook import Shown
from gapwalk.picture_parts import described, description_of
from gapwalk.plot.style import CARD, GREY, SizeName, broken, in_style, points, present, rc, sheet_size, sized, styled
from gapwalk.studies.export import write_whole
from gapwalk.studies.result import Result
from gapwalk.studies.study_kind import kind_of, kinds
from gapwalk.summary import Table, Tree

# Sheets and windows for pictures, their headings and legends, and their files.

AnyFigure = Figure | SubFigure

Inches = tuple[float, float]
"""Width and height in inches on a screen; see `gapwalk.plot.style.sized` for other sizes."""

WIDE: Inches = (8.0, 4.8)
"""The size of a picture of one panel."""

_PACKED = 3  # compression level, of 9: without opacity files are as small as at 6, in two thirds of the time
_BESIDE = 1.2  # spaces next to the line of each entry of a legend, in sizes of its letters
NARROW = 4.0  # inches of a sheet up to which the lines and the spaces of a legend are short
_OVER = 1.2  # height of a label, as a factor of its panel's, from which it meets that of the next one
_FILL_COLUMNS = 6  # most columns of a legend of fills


def stacked(panels: int) -> Inches:
    """Return the size of a picture of several panels, one above the other."""
    return WIDE[0], 4.3 * panels


def new_sheet(size: Inches = WIDE) -> Figure:
    """Create a figure without pyplot, which is freed when it has been written.

    Parameters
    ----------
    size
        Width and height in inches on a screen.

    Returns
    -------
    Figure
        A figure of matplotlib.
    """
    with in_style():
        figure = Figure(figsize=sheet_size(*size), dpi=present().dpi, layout="constrained")
    FigureCanvasAgg(figure)  # the same renderer measures texts for the layout and draws them
    return figure


def open_window(size: Inches = WIDE) -> Figure:
    """Open a figure of pyplot: it is shown in a window, or below the cell of a notebook."""
    # It must be opened outside of `in_style`, because the first one loads the display backend, which changes settings.
    import matplotlib.pyplot as plt  # imported late: it selects the display backend, which takes long

    return plt.figure(figsize=sheet_size(*size), layout="constrained")


def close_window(figure: Figure) -> None:
    """Close a window again, if the figure has one."""
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close(figure)


def lay_out(figure: Figure, *, keep: bool = False) -> None:
    """Compute the layout of a figure, so that labels placed afterwards stay in place."""
    engine = figure.get_layout_engine()
    with in_style():
        if engine is not None:
            engine.execute(figure)
        elif keep:
            figure.draw_without_rendering()
    changed = [shorten_label(ax) for ax in figure.axes]
    if any(changed) and engine is not None:
        with in_style():
            engine.execute(figure)
    if engine is not None and not keep:
        figure.set_layout_engine(None)


def write_heading(figure: AnyFigure, title: str) -> None:
    """Write a title above a whole picture, at the left."""
    if title and present().title:
        figure.suptitle(title, x=0.01, ha="left", fontsize=rc()["axes.titlesize"], wrap=True)


def write_answer(figure: AnyFigure, title: str, sentences: Sequence[str]) -> None:
    """Write a title above a whole picture, and the answer that the picture shows below the title."""
    write_heading(figure, "\n".join(filter(None, (title, *(each.replace("$", r"\$") for each in sentences)))))


def write_letters(panels: Sequence[Axes]) -> Callable[[], None]:
    """Write a, b, c into the corners of panels; return a function that moves them off what is drawn."""
    texts = zip("abcdef", panels, strict=False)
    letters = [panel.text(*_CORNERS[0], text, transform=panel.transAxes, va="top", **_BOLD) for text, panel in texts]

    def move() -> None:
        for letter in letters:
            for x, y in (*_CORNERS, _CORNERS[0]):
                letter.set(position=(x, y), ha="left" if x < 0.5 else "right", va="bottom" if y < 0.5 else "top")
                if not _is_drawn_on(letter):
                    break

    return move


_CORNERS = ((0.012, 0.975), (0.988, 0.975), (0.012, 0.025), (0.988, 0.025))  # of letters, in the order of preference
_BOLD: Any = {"weight": "bold", "zorder": 7}


def _is_drawn_on(text: Text) -> bool:
    """Return True if a line or a symbol of its axes crosses a text."""
    assert text.axes is not None
    box = text.get_window_extent().padded(points(2.0) * text.axes.figure.figure.dpi / 72.0)
    for line in text.axes.lines:
        path = line.get_transform().transform_path(line.get_path())
        is_line = line.get_linestyle() != "None"
        if path.intersects_bbox(box, filled=False) if is_line else box.count_contains(path.vertices):
            return True
    return False


def show_whole_symbols(ax: Axes) -> None:
    """Let symbols at the frame reach beyond it, in pictures that are files: in a window, ranges may change."""
    if ax.figure.figure.canvas.manager is not None:
        return
    ranges = [sorted(ax.get_xlim()), sorted(ax.get_ylim())]
    for line in ax.lines:
        if line.get_linestyle() == "None" and line.get_transform() == ax.transData:
            values = np.array(line.get_data(), dtype=float)
            inside = np.all([(low <= own) & (own <= high) for own, (low, high) in zip(values, ranges, strict=True)], 0)
            line.set(data=values[:, inside], clip_on=False, in_layout=False)


_written: WeakKeyDictionary[Legend, list[Artist]] = WeakKeyDictionary()  # what each legend explains


def write_legend(
    place: Axes | AnyFigure,
    entries: Sequence[tuple[str, Any]],
    where: Literal["below", "above", "inside"] = "below",
    note: str = "",
    instead: Collection[str] = (),
) -> None:
    """Write a legend of lines, symbols and fills, in place of earlier entries with the texts of `instead`."""
    if not present().legend:
        return
    handles: list[Artist] = [
        Patch(facecolor=options, edgecolor=GREY, linewidth=0.5, label=text)
        if isinstance(options, str)
        else Line2D([], [], label=text, **options)
        for text, options in entries
    ]
    if not handles:
        return
    fills = any(isinstance(handle, Patch) for handle in handles)
    figure: Any = place.figure if isinstance(place, Axes) else place
    narrow = is_narrow(figure)  # no legend finds room beside the curves of its panels
    alone = isinstance(figure, Figure) and figure.get_constrained_layout()
    alone = alone and (fills or narrow or len(figure.axes) == 1)
    is_below = not isinstance(place, Axes) or (alone and where == "below")
    for before in [place.get_legend()] if isinstance(place, Axes) and not is_below else [*figure.legends]:
        if before is not None and before in _written:  # that of another record in the same place
            known, note = {*(each.get_label() for each in handles), *instead}, note or before.get_title().get_text()
            handles = [*(each for each in _written[before] if each.get_label() not in known), *handles]
            before.remove()
    fills = any(isinstance(handle, Patch) for handle in handles)
    size: dict[str, Any] = {"columnspacing": 0.9 if narrow else 1.6}
    size["handlelength"] = 1.3 if fills else 2.3 if narrow else 2.9
    if note:
        size |= {"title": note, "title_fontsize": points(7.0)}
    if where == "above" and isinstance(place, Axes):
        corner = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        legend = place.legend(handles=handles, ncols=_columns(figure, handles, size), **corner, **size)
    elif is_below:
        below = "outside lower center" if figure.figure.get_constrained_layout() else "lower center"
        legend = figure.legend(handles=handles, loc=below, ncols=_columns(figure, handles, size, fills), **size)
    else:
        legend = place.legend(handles=handles, loc="best", frameon=fills, **size)
    legend.get_title().set_color(GREY)
    _written[legend] = handles


def _columns(figure: AnyFigure, handles: Sequence[Artist], spaces: Mapping[str, float], fills: bool = False) -> int:
    """Return the number of columns of a legend: one row or two, or as many columns as fit the width of the sheet."""
    count, size = len(handles), float(rc()["legend.fontsize"])
    wanted = min(count, _FILL_COLUMNS) if fills else -(-count // (1 if count < 5 else 2))
    font = FontProperties(size=size)
    texts = [TextToPath().get_text_width_height_descent(str(each.get_label()), font, False)[0] for each in handles]
    unit = figure.figure.dpi_scale_trans.transform((1.0 / 72.0, 0.0))[0]
    widths = unit * (np.array(texts) + (spaces["handlelength"] + spaces["columnspacing"] + _BESIDE) * size)
    room = figure.bbox.width

    def fits(columns: int) -> bool:
        return sum(map(max, np.array_split(widths, columns))) < room

    most = next((n for n in range(wanted, 1, -1) if fits(n)), 1)
    even = -(-count // -(-count // most))  # as many rows, but none with a single entry
    return even if fits(even) else most


def is_narrow(figure: AnyFigure) -> bool:
    """Return True if a picture is as narrow as a column of a journal."""
    return figure.figure.get_figwidth() < NARROW


def shorten_label(ax: Axes) -> bool:
    """Leave out what stands in brackets in the label of a vertical axis that does not fit, or break it into lines."""
    # It is cut off at an edge of the picture, or reaches into the next panel.
    if not (text := ax.get_ylabel()) or ax.name == "3d":
        return False
    box, figure = ax.yaxis.label.get_window_extent(), ax.figure.figure
    is_high = len(figure.axes) > 1 and box.height > _OVER * ax.get_window_extent().height
    if box.y0 < 0.0 or box.y1 > figure.bbox.height or is_high:
        shorter = re.sub(r"\s+\([^)]*\)", "", text)
        ax.set_ylabel(shorter if shorter != text or "\n" in text else broken(text, 0.0))
    return ax.get_ylabel() != text


def sheet_bytes(figure: Figure, form: str) -> bytes:
    """Render a figure as the content of a file: ``png``, ``svg`` (reproducible byte for byte) or ``pdf``."""
    lay_out(figure)
    with in_style():
        if form == "png":
            return png_bytes(figure)
        content = io.BytesIO()
        metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}[form]
        figure.savefig(content, format=form, dpi=figure.dpi, metadata=metadata)
        return content.getvalue()


def png_bytes(figure: Figure, dpi: float | None = None) -> bytes:
    """Render a PNG as `savefig` does but without opacity: paper is white, and compression is twice as fast."""
    from PIL import Image  # imported late: it is installed with matplotlib

    content = io.BytesIO()
    dpi = dpi or figure.dpi
    figure.set_dpi(dpi)
    canvas = figure.canvas if isinstance(figure.canvas, FigureCanvasAgg) else FigureCanvasAgg(figure)
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(content, format="png", dpi=(dpi, dpi), compress_level=_PACKED)
    return content.getvalue()


Finish = Callable[[], None] | None
"""Function that draws what needs the final layout (labels, close-ups); None if there is nothing."""

Draw = TypeVar("Draw", bound=Callable[..., Any])

FORMS = ("png", "svg", "pdf")
"""File formats and their file extensions."""

# Modules of this package that draw the types of gapwalk, imported when such a record is first drawn.
_MODULES = {
    "answers": ("OrderMap", "RunUp", "Scan", "Tolerance"),
    "branches": ("Branch", "Diagram"),
    "cells": ("BasinShares", "Regimes", "Sweep"),
    "comparisons": ("Alignment", "Contrast", "Fit", "ResultComparison"),
    "loci": ("Family", "Locus", "Map"),
    "models": ("System",),
    "motions": (
        *("Attractor", "Energy", "Hysteresis", "Modes", "Motion", "Orbit"),
        *("Section", "Settled", "Spectrum", "StickSlip", "Torus", "Waterfall"),
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
        True if the function is called with a figure and creates panels in it; False if it is called with axes. A type
        may have a function of each sort: the second then draws the type in a notebook or in a panel of a larger figure.
    size, shows, alone, several
        As in `Drawing`.

    Returns
    -------
    decorator
        A decorator that registers the function and returns it unchanged.

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
        if (description := description_of(kind)) is not None:
            from gapwalk.plot.answers import drawing_of_answer  # it draws with this module

            for form, drawings in (("axes", _IN_AXES), ("panels", _IN_PANELS)):
                if form in description.forms and kind not in drawings:
                    drawings[kind] = drawing_of_answer(description, in_axes=form == "axes")
        found = _IN_AXES.get(kind) if in_axes else _IN_PANELS.get(kind, _IN_AXES.get(kind))
        if found is not None:
            if first is not record and not (found.several and all(isinstance(each, kind) for each in record)):
                names = ", ".join(dict.fromkeys(type(each).__name__ for each in record))
                raise ModelError(f"a list of {names} has no picture in common; draw them one by one, with ax=...")
            return found, found is _IN_AXES.get(kind)
        if kind in _IN_PANELS:
            raise ModelError(f"a {kind.__name__} is drawn in several panels: give figure=..., not ax=...")
    for name in kinds():  # the modules of all records
        kind_of(name)
    known = {*_HOMES, *(name for name, each in described().items() if each.forms)}
    raise ModelError(
        f"there is no picture of a {type(first).__name__}; there are pictures of {', '.join(sorted(known))}"
    )


def draw(
    record: Any,
    *arguments: Any,
    ax: Axes | None = None,
    figure: AnyFigure | None = None,
    title: str | None = None,
    size: SizeName | None = None,
    style: Mapping[str, Any] | None = None,
    **options: Any,
) -> Axes:
    """Draw a record: a branch, several of them in a list, a diagram, a motion, a result, ...

    Parameters
    ----------
    record
        The record to draw.
    *arguments, **options
        Options of the picture: see the page "Options of pictures", or the method `plot` of the record.
    ax
        Axes to draw in. A picture with several panels is reduced to one panel, or an error asks for `figure`.
    figure
        A figure, or a part of one, to draw in; by default a new figure of pyplot.
    title
        Plain text above the picture; by default taken from the record.
    size
        Size of a new figure: ``"column"``, ``"page"``, ``"slide"`` or ``"screen"``; see `sized`.
    style
        Colours, line styles, symbols and fonts by name; see `styled`.

    Returns
    -------
    Axes
        The axes of the picture, or of its first panel; ``axes.figure.axes`` are those of all panels.

    Raises
    ------
    ModelError
        If the record has no picture, there is no such measure or size, or there is nothing to draw yet.
    TypeError
        If the picture has no such option.

    Examples
    --------
    >>> gw.plot.draw(branch, "max.x", size="column").get_xlabel() != ""
    True
    """
    with sized(size), styled(style):
        return _draw(record, arguments, options, title, open_window, ax, figure)


@contextmanager
def figure(width: float, height: float, title: str = "") -> Iterator[Figure]:
    """Create a figure of several panels in the common style, to be written by `save`.

    Draw into its axes and subfigures with `draw` or with matplotlib. The layout is computed at the end of the `with`
    block, and labels of special points and branches are placed only then: until then the sizes of panels change, and
    labels would lie on curves.

    Parameters
    ----------
    width, height
        Size in inches on a screen; in a block of `sized` it is converted to the size of a column, a page or a slide.
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
            lay_out(sheet, keep=True)
            for finish in _postponed.get() or ():
                finish()
            lay_out(sheet)
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
    """
    record, options, _ = unpacked(record, options, None, in_axes=True)
    drawing, _ = drawing_of(record, in_axes=True)
    with in_style():
        finish = drawing.draw(record, ax, **drawing.named(arguments, options, record))
    return in_style()(finish or (lambda: None))


def picture_of(record: Any, *arguments: Any, title: str | None = None, **options: Any) -> Figure:
    """Draw a record on a separate sheet, without pyplot; parameters as in `draw`."""
    sheet = _draw(record, arguments, options, title, new_sheet).get_figure(root=True)
    assert isinstance(sheet, Figure)
    return sheet


def save(
    record: Any,
    *paths: str | os.PathLike[str],
    form: str | None = None,
    title: str | Literal[False] | None = None,
    size: SizeName | None = None,
    legend: bool = True,
    style: Mapping[str, Any] | None = None,
    **options: Any,
) -> None:
    """Draw a record and write it to files.

    Parameters
    ----------
    record
        The record, as in `draw`; or a figure of matplotlib, which is written without changes to its contents.
    *paths
        The files, with the extension ``.png``, ``.svg`` or ``.pdf``; SVG and PDF files contain vector graphics.
    form
        Format of files with another extension: ``"png"``, ``"svg"`` or ``"pdf"``.
    title, size, style, **options
        As in `draw`; `title` is by default that of the study, and False for no title.
    legend
        False for a picture without a legend.

    Raises
    ------
    ModelError
        For another extension without `form`, and as in `draw`.
    StoreError
        If a file cannot be written.

    Examples
    --------
    >>> gw.plot.save(branch, "branch.pdf", "branch.svg", measure="max.x", size="column")
    """
    if isinstance(record, Figure) and (title is not None or size is not None or style is not None or options):
        raise ModelError("a figure has its own measure, title and size; leave them out, or draw a figure with them")
    forms = [form or Path(path).suffix.lower().removeprefix(".") for path in paths]
    for path, each in zip(paths, forms, strict=True):
        if each not in FORMS:
            raise ModelError(f"{os.fspath(path)} is not a name for a picture; give it the ending .png, .svg or .pdf")
    with sized(size), styled(style):
        now = present()
        bare = replace(now, title=now.title and title is not False, legend=now.legend and legend)
        with sized(bare):
            figure = record if isinstance(record, Figure) else picture_of(record, title=title or None, **options)
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
) -> Axes:
    """Draw a record into axes, a figure, or a new figure of the appropriate size."""
    record, options, title = unpacked(record, options, title, in_axes=ax is not None)
    drawing, in_axes = drawing_of(record, in_axes=ax is not None)
    options = drawing.named(arguments, options, record)
    title = options.pop("title", title)
    if ax is None and not present().title:
        title = ""
    if title is not None and "title" in drawing.options:
        options["title"] = title.replace("$", r"\$")
    opened = None
    if ax is None and figure is None:
        options = {**drawing.alone, **options}
        figure = opened = make(drawing.sheet(record, options))
    try:
        with in_style():
            first = 0 if figure is None else len(figure.axes)
            place: Any = ax if ax is not None else figure.add_subplot() if in_axes and figure else figure
            if in_axes and title:
                place.set_title(title.replace("$", r"\$"), wrap=True)
            finish = drawing.draw(record, place, **options)
            postponed = _postponed.get()
            if finish and postponed is not None:
                postponed.append(in_style()(finish))
            elif finish:
                lay_out(place.get_figure(root=True), keep=True)
                finish()
    except BaseException:
        if opened is not None:
            close_window(opened)  # otherwise pyplot would show an empty window
        raise
    return place if in_axes else place.axes[first]


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


# Cards of records in a notebook: the lines, tables and trees of their summary, and a small picture.

_CELL = "text-align: {}; padding: 1px 12px 1px 0; background: none; vertical-align: top"
_MOST = 12  # most rows of a table, lines of a tree, and lines outside of both
_LONGEST = 300  # most letters of a line
_DPI = 110


def card_of(record: Shown) -> str:
    """Write the card of a record as HTML, with the colours of the page and without external files."""
    title = getattr(record, "title", "") or type(record).__name__
    parts, lines = [f"<b>{html.escape(title)}</b>"], []
    for part in record.summary():
        if isinstance(part, Table):
            headings, is_right = zip(*part.columns, strict=True)
            rows = [_row(headings, is_right, "th"), *(_row(row, is_right, "td") for row in part.rows)]
            parts.append(f'<table style="margin: 4px 0; border: none">{"".join(_first(rows, "<tr><td>{}</td></tr>"))}')
            parts.append("</table>")
        elif isinstance(part, Tree):
            parts += _first(list(_branches(part, 0)), "<div>{}</div>")
        else:
            lines.append(f"<div>{_text(part)}</div>")
    parts[1:1] = _first(lines, "<div>{}</div>")
    left = f'<div style="flex: 0 1 auto">{"".join(parts)}</div>'
    picture = _picture(record)
    return f'<div style="display: flex; flex-wrap: wrap; gap: 4px 24px; align-items: flex-start">{left}{picture}</div>'


def _row(cells: Sequence[str], is_right: Sequence[bool], kind: str) -> str:
    sides = ("right" if each else "left" for each in is_right)
    texts = (
        f'<{kind} style="{_CELL.format(side)}">{_text(cell)}</{kind}>' for side, cell in zip(sides, cells, strict=True)
    )
    return f'<tr style="background: none; border: none">{"".join(texts)}</tr>'


def _branches(tree: Tree, depth: int) -> Iterator[str]:
    yield f'<div style="margin-left: {1.5 * depth}em">{_text(tree.label)}</div>'
    for child in tree.children:
        yield from _branches(child, depth + 1)


def _first(lines: list[str], last: str) -> list[str]:
    """Return the first lines, and a line with the number of further ones."""
    return lines if len(lines) <= _MOST else [*lines[:_MOST], last.format(f"and {len(lines) - _MOST} more")]


def _text(text: str) -> str:
    return html.escape(text if len(text) <= _LONGEST else f"{text[:_LONGEST]} ...").replace("\n", "<br>")


def _picture(record: Shown) -> str:
    """Draw a small picture embedded in the page; return an empty text if there is none."""
    try:
        record, _, _ = unpacked(record, {}, None, in_axes=True)
        drawing, _ = drawing_of(record, in_axes=True)
        plain = {name: False for name in ("labels", "legend") if name in drawing.options}
        with sized(CARD), in_style():
            figure = new_sheet()
            if finish := drawing.draw(record, figure.add_subplot(), **plain):
                finish()
            data = base64.b64encode(png_bytes(figure, _DPI)).decode()
    except GapwalkError:
        return ""
    return f'<img alt="" style="max-width: 460px; margin: 0" src="data:image/png;base64,{data}">'
