"""Answers on the page: the protocol by which a record of a study says what the page draws of it, and its registry.

An answer has sentences, curves with points to choose, what is drawn over the diagram and below it, tables, and
pictures. A record whose type is not registered has its sentences and tables alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.bifurcation.special_point import SpecialPoint
from gapwalk.explorer.answer_picture import AnswerPicture
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words
from gapwalk.studies.study_kind import Finding
from gapwalk.summary import Table, text_of

_SAME = 1e-9  # relative difference up to which two values of a special point are one
_DIGITS = 7  # that a screen can show
_ROWS = 60  # of a table

Json = dict[str, Any]


class AnswerView:
    """Content of the page for one type of record.

    Subclasses override what they have; `shown` registers them. Amounts are in the units of the model. The entries of
    lists may have the key ``of``, the name of a contact: they are shown while that contact is chosen.
    """

    script: ClassVar[str] = "()"
    """Python text of the branches and loci of a variable ``record``, in the order of `curves`."""

    def __init__(self, finding: Finding) -> None:
        self.finding, self.record = finding, finding.record

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return its branches and loci with their names; branches come first."""
        return []

    @property
    def earlier(self) -> tuple[int, ...]:
        """Indices of the curves of the system before a change, which are drawn pale."""
        return ()

    @property
    def axes(self) -> tuple[str, str] | None:
        """Names of the quantities of the axes over which it is shown; None if it has no place in a diagram."""
        return None

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of parameters in which its curves differ, besides those along which they go."""
        return ()

    @property
    def contacts(self) -> Sequence[str]:
        """Names of the contacts of which one is chosen."""
        return ()

    def pictures(self) -> Sequence[AnswerPicture]:
        """Return pictures of the record and of its parts by `gapwalk.plot`; each is drawn when it is asked for."""
        return ()

    @property
    def system(self) -> System:
        """The system of the record."""
        return self.record.system

    def sentences(self) -> list[str]:
        """Return the answer in sentences; of unfinished work without a record, how much is stored."""
        first = [part for part in self._parts()[:1] if isinstance(part, str)]
        return first or [self.finding.stored]

    def drawn(self) -> Json:
        """Return the curves and axes of the picture."""
        return {}

    def content(self) -> Json:
        """Return all of it as JSON values."""
        sentences = self.sentences()
        rest = [part for part in self._parts() if part not in sentences]
        notes = (*self.finding.notes, *self.finding.failures)
        return {
            "sentences": sentences,
            "parts": [_plain(part) for part in rest if part != ""],
            "notes": [] if self.record is None else list(notes),
            "contacts": list(self.contacts),
            "axes": self.axes,
            "complete": self.finding.complete,
            "pictures": [each.text for each in self.pictures()],
            **self.drawn(),
        }

    def _parts(self) -> Sequence[Any]:
        parts = () if self.record is None else self.finding.summary()
        return [part.strip("\n") if isinstance(part, str) else part for part in parts]

    def place_of(self, special: SpecialPoint | None) -> Json | None:
        """Return ``branch`` and ``special``, the indices of a special point among the curves; None if it has none."""
        for number, (_, curve) in enumerate(self.curves()):
            for index, each in enumerate(curve.special_points if isinstance(curve, Branch) else ()):
                if special is not None and each.kind == special.kind and _is_same(each.value, special.value):
                    return {"branch": number, "special": index}
        return None


def _is_same(one: float, other: float) -> bool:
    return abs(one - other) <= _SAME * max(abs(one), abs(other))


def _plain(part: Any) -> str | Json:
    """Return a part of a summary as JSON values: a text, or a table."""
    if isinstance(part, str):
        return part
    if not isinstance(part, Table):
        return text_of((part,))
    return {
        "head": [list(column) for column in part.columns],
        "rows": [list(row) for row in part.rows[:_ROWS]],
        "groups": list(part.groups),
        "left_out": max(0, len(part.rows) - _ROWS),
    }


Maker = Callable[[Finding], AnswerView]
View = TypeVar("View", bound=AnswerView)

_VIEWS: dict[type, Maker] = {}


def shown(record: type) -> Callable[[type[View]], type[View]]:
    """Register the view of a type of record."""

    def register(view: type[View]) -> type[View]:
        _VIEWS[record] = view
        return view

    return register


def has_picture(record: object) -> bool:
    """Return True if the page draws a record of this type, and shows more than sentences and tables."""
    return type(record) in _views()


def view_of(finding: Finding) -> AnswerView:
    """Return the view of a finding: that of its type of record, or sentences and tables alone."""
    return _views().get(type(finding.record), AnswerView)(finding)


def _views() -> dict[type, Maker]:
    # they register themselves
    from gapwalk.explorer import (
        cell_views,
        change_views,
        family_view,
        free_views,
        rattle_views,
        run_up_view,
        sweep_view,
        torus_views,
    )

    del cell_views, change_views, family_view, free_views, rattle_views, run_up_view, sweep_view, torus_views
    return _VIEWS


class Alone(Finding):
    """Record that comes from no study, such as that of a Python function."""

    def __init__(self, record: Any) -> None:
        self._record = record

    @property
    def record(self) -> Any:
        """The record."""
        return self._record

    @property
    def complete(self) -> bool:
        """True unless the record says that something is missing; one that cannot be unfinished does not say."""
        return getattr(self._record, "complete", True)

    @property
    def stored(self) -> str:
        """Nothing: it is in no file."""
        return ""

    def summary(self) -> Any:
        """Return the sentences of the record."""
        return self._record.summary() if hasattr(self._record, "summary") else (repr(self._record),)

    def document(self, points: bool) -> Json:
        """Return the record as JSON values."""
        return self._record.to_dict()

    def tables(self) -> Any:
        """Return its tables."""
        return self._record.tables()


class Series(NamedTuple):
    """Points or a line in a picture."""

    #: x, y: Coordinates.
    x: ArrayLike
    y: ArrayLike
    mark: str = "line"  #: ``line``, ``dots``, ``crosses``, ``stars``, or ``area`` down to zero.
    look: str = "main"  #: Style: a class of the style sheet of the page.
    text: str = ""  #: Legend; empty for none.
    of: str = ""  #: Contact; empty for all.
    axes: tuple[str, ...] = ()  #: Names of the quantities over which it is drawn; empty in a panel of its own.

    @property
    def plain(self) -> Json:
        """The series as JSON values."""
        return {**self._asdict(), "x": numbers(self.x), "y": numbers(self.y), "axes": list(self.axes)}


def panel(
    title: str, over: str, system: System, series: Iterable[Series], of: str = "", *, fitted: bool = False
) -> Json:
    """Return a panel of series over a parameter; a fitted one shows their range alone, others also zero."""
    across = parameter_words(over, system.units)
    lines = [each.plain for each in series]
    return {"title": title, "over": over, "across": across, "series": lines, "of": of, "fitted": fitted}


def numbers(values: ArrayLike) -> list[float | None]:
    """Return numbers with the digits that a screen can show; None for what is not finite."""
    array = np.asarray(values, dtype=float)
    return [float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None for value in array.tolist()]


def with_unit(words: str, unit: str | None) -> str:
    """Return the title of an axis."""
    return f"{words} [{unit}]" if unit else words


def unit_of(name: str, system: System) -> str:
    """Return the unit of a parameter; empty without units."""
    return system.units.parameter(name) if system.units else ""
