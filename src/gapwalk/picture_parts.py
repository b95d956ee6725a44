"""The description of the picture of an answer: curves, series, shades, lines, cells and panels, for paper and page.

A type of record has one function that returns its `Picture`, registered by `pictured`. `gapwalk.plot.answers` draws it
on paper, `gapwalk.explorer.answer_view` on the page; the names of styles are the same for both.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal, NamedTuple, TypeVar

from numpy.typing import ArrayLike, NDArray

Inches = tuple[float, float]

_SAME = 1e-9  # relative difference up to which two values of a special point are one

# Modules that describe the records of packages below them, imported when such a record is first shown.
_HOMES = {"attractors": "plot.cells", "free": "answers.curve_pictures", "tori": "answers.curve_pictures"}

SECTION = "section."
"""Prefix of a state at the start of the forcing period: ``section.q1``."""

START = "start."
"""Prefix of a state from which motions begin: ``start.q1``."""


NATURAL_FREQUENCY = "natural_frequency"
"""Quantity upwards of a Campbell diagram."""


class NamedCurve(NamedTuple):
    """A branch or a locus, of which points can be chosen on the page."""

    name: str  #: Name on the page.
    curve: Any  #: The branch or locus.
    look: str = ""  #: Style on paper; empty for the lines of stability.
    text: str = ""  #: Legend on paper.
    points: Sequence[Any] | None = None  #: Points that are drawn on paper; by default all.
    is_earlier: bool = False  #: True if it is that of the system before a change, which is drawn pale.
    marks: Iterable[Any] = ()  #: Kinds of special points that are marked on paper, of a curve that has a look.

    @property
    def marked(self) -> list[Any]:
        """Special points that are marked."""
        return [each for each in self.curve.special_points if each.kind in self.marks]


def curves_of_loci(loci: Iterable[Any], text: str) -> list[NamedCurve]:
    """Return loci as curves with names such as ``grazing-2``, and a legend that contains their kind."""
    return [
        NamedCurve(f"{each.kind.value}-{k}", each, "", text.format(each.kind)) for k, each in enumerate(loci, start=1)
    ]


class Series(NamedTuple):
    """Points or a line."""

    #: x, y: Coordinates.
    x: ArrayLike
    y: ArrayLike
    #: ``line``, ``dots``, ``crosses``, ``stars``, ``area`` down to zero, or ``between`` two rows of y.
    mark: str = "line"
    look: str = "main"  #: Style: a class of the style sheet of the page, and a name in `gapwalk.plot.answers`.
    text: str = ""  #: Legend; empty for none.
    of: str = ""  #: Contact; empty for all.
    axes: tuple[str, ...] = ()  #: Names of the quantities over which it is drawn; empty in a panel of its own.
    symbol: str = ""  #: Symbol on paper in place of mark and look, where paper distinguishes more.
    notes: Sequence[str] = ()  #: Text next to each point, on paper; of a line on the page, too.
    #: A number for each point: paper shows a smooth curve, with corners where this changes.
    corners: Sequence[int] | None = None
    #: The branch along which the series lies, and a function of its points: paper shows where it is stable.
    along: tuple[Any, Callable[[Any], float]] | None = None


def events_of(
    symbols: Mapping[str, str], found: Sequence[tuple[str, float, float]], axes: tuple[str, ...] = (), faint: str = ""
) -> Iterator[Series]:
    """Yield what happens along curves, given by its kind and place: a star for each kind, a cross for a faint one."""
    for kind, symbol in symbols.items():
        x, y = ([place[axis] for place in found if place[0] == kind] for axis in (1, 2))
        mark, look = ("crosses", "measured") if kind == faint else ("stars", "worst")
        if x:
            yield Series(x, y, mark, look, kind, axes=axes, symbol=symbol)


def look_of(number: int) -> str:
    """Return the look of one of several curves."""
    return ("first", "second", "third", "fourth")[number % 4]


class Shade(NamedTuple):
    """A range of a quantity."""

    over: str  #: The quantity.
    #: low, high: Its ends.
    low: float
    high: float
    tint: str  #: Colour: a name as of looks.
    text: str = ""  #: Legend.
    of: str = ""  #: Contact; empty for all.


class Line(NamedTuple):
    """A value of a quantity, drawn over the whole height."""

    over: str  #: The quantity.
    at: float  #: The value.
    text: str = ""  #: Text above it.
    exact: bool = True  #: False for a dotted line.
    of: str = ""  #: Contact; empty for all.
    kind: str = ""  #: What happens there, below the text on paper.


class Panel(NamedTuple):
    """A panel of series over a parameter."""

    title: str  #: Quantity upwards, in words.
    over: str  #: The parameter.
    series: Sequence[Series]
    of: str = ""  #: Contact; empty for all.
    fitted: bool = False  #: True to show the range of the series alone; False to show zero too.
    across: str = ""  #: Quantity across in words, if it is not the parameter.
    height: float = 1.0  #: Height on paper.
    margin: float | None = None  #: Room beside the series on paper, as a share of their range; by default usual room.
    logarithmic: Literal["", "x", "y"] = ""  #: Axis on paper that is logarithmic.


class Cells(NamedTuple):
    """A plane of cells."""

    codes: NDArray[Any]  #: Index of the entry of each cell, shape (rows, columns).
    #: Legend and colour of each code. The colour is a name of a tint, with ``-wild`` if the motion is not periodic.
    entries: Sequence[tuple[str, str]]
    within: tuple[tuple[float, float], tuple[float, float]]  #: Ranges of both quantities.
    of: str = ""  #: Contact; empty for all.


class End(NamedTuple):
    """A place that the answer names, with what moves it."""

    text: str
    kind: str
    special: Any = None  #: Special point of a curve; None for a place that has a gradient of its own.
    most: str = ""  #: What moves it most, in words.
    of: str = ""  #: Contact; empty for all.
    place: Mapping[str, float] | None = None
    gradient: Callable[[], Any] | None = None


class Cloud(NamedTuple):
    """Values of a special point in many systems."""

    over: str  #: The parameter.
    kind: str
    title: str
    x: ArrayLike  #: Some of the values.
    quantiles: ArrayLike  #: Their 5 %, 50 % and 95 %.
    lines: Sequence[str]  #: What they mean, in words.
    special: Any  #: The special point.


class Bar(NamedTuple):
    """Change of a number, within its limits, in percent."""

    name: str
    low: float
    high: float
    moved: float
    text: str


class Whole(NamedTuple):
    """A picture on paper that the page shows, too."""

    text: str  #: What it shows, in words.
    record: Any  #: The record.
    form: Literal["svg", "png"] = "svg"  #: ``svg``, or ``png`` for surfaces.
    options: Mapping[str, Any] = {}  #: Options of its drawing.


@dataclass(frozen=True, eq=False)
class Parts:
    """The parts of a picture over its curves, below them and beside them."""

    layers: Iterable[Series] = ()  #: Series over both axes.
    paper: Iterable[Series] = ()  #: Further series over both axes, on paper alone.
    shades: Iterable[Shade] = ()
    lines: Iterable[Line] = ()
    cells: Iterable[Cells] = ()
    below: Iterable[Panel] = ()  #: Panels over the same parameter.
    charts: Iterable[Panel] = ()  #: Panels over another quantity.
    ends: Iterable[End] = ()
    within: Mapping[str, tuple[float, float]] = field(default_factory=dict)  #: Ranges of the axes.
    clouds: Iterable[Cloud] = ()  #: Values of special points, on the page.
    bars: Iterable[Bar] = ()
    quantities: Sequence[str] = ()  #: Quantities that the axes of the page offer.
    more: Mapping[str, Any] = field(default_factory=dict)  #: Further values of the page.


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of an answer."""

    system: Any  #: The system.
    axes: tuple[str, str] | None = None  #: Quantities across and upwards; None if it has no place in a diagram.
    curves: Sequence[NamedCurve] = ()  #: Branches first.
    parts: Callable[[], Parts] = Parts  #: Computes the rest, when it is drawn.
    sentences: Sequence[str] = ()  #: The answer on the page; by default the first line of the summary.
    heading: Sequence[str] = ()  #: The answer on paper.
    contacts: Sequence[str] = ()  #: Contacts of which one is chosen.
    of: str = ""  #: The one that is drawn on paper.
    parameters: Sequence[str] = ()  #: Parameters in which curves differ, besides those along which they go.
    wholes: Sequence[Whole] = ()  #: Pictures on paper that the page shows, too.
    #: Python text of the curves of a variable ``record``, in their order.
    script: str = "()"
    #: Panels on paper, from the top.
    panels: tuple[Literal["main", "below", "charts", "bars"], ...] = ("main", "below")
    words: tuple[str, str] = ("", "")  #: Words across and upwards on paper, in place of those of the axes.
    labels: bool = False  #: True if the special points of curves without a look have labels on paper.
    #: Ranges of the axes on paper; None if they are those of the page.
    reach: Mapping[str, tuple[float | None, float | None]] | None = None
    logarithmic: Literal["", "x", "y"] = ""  #: Axis on paper that is logarithmic.
    height: float = 1.0  #: Height of the main panel on paper.
    note: str = ""  #: Line below the legend on paper.
    empty: str = ""  #: Why nothing is drawn.

    def place_of(self, special: Any) -> dict[str, int] | None:
        """Return ``branch`` and ``special``, the indices of a special point among the curves; None if it has none."""
        for number, each in enumerate(self.curves):
            for index, other in enumerate(getattr(each.curve, "special_points", ())):
                if special is not None and other.kind == special.kind and _is_same(other.value, special.value):
                    return {"branch": number, "special": index}
        return None


def _is_same(one: float, other: float) -> bool:
    return abs(one - other) <= _SAME * max(abs(one), abs(other))


class Description(NamedTuple):
    """How a type of record is described."""

    describe: Callable[..., Picture]  #: Its parameters after the record are options of the picture.
    size: Inches | Callable[..., Inches]  #: Size on a screen, in inches, or a function of the record that returns it.
    #: Where `gapwalk.plot.answers` draws it: in ``axes``, in the ``panels`` of a figure; on the page alone if nowhere.
    forms: Sequence[str]
    several: bool = False  #: True if a list of records is one picture, too.

    @property
    def options(self) -> list[inspect.Parameter]:
        """Parameters after the record."""
        return [*inspect.signature(self.describe).parameters.values()][1:]


D = TypeVar("D", bound=Callable[..., Picture])
_KNOWN: dict[type, Description] = {}


def pictured(
    *records: type,
    size: Inches | Callable[..., Inches] = (8.0, 4.8),
    forms: Sequence[str] = ("axes", "panels"),
    several: bool = False,
) -> Callable[[D], D]:
    """Register the function that describes the picture of records of these types."""

    def register(describe: D) -> D:
        _KNOWN.update(dict.fromkeys(records, Description(describe, size, forms, several)))
        return describe

    return register


def description_of(kind: type) -> Description | None:
    """Return how a type of record is described; None if it is not."""
    package, name = f"{kind.__module__}.".split(".")[:2]
    if package == "gapwalk" and name in _HOMES:
        import_module(f"gapwalk.{_HOMES[name]}")
    return _KNOWN.get(kind)


def described() -> dict[str, Description]:
    """Return how types of record are described by the packages that are loaded, by their names."""
    for home in _HOMES.values():
        import_module(f"gapwalk.{home}")
    return {kind.__name__: found for kind, found in _KNOWN.items()}
