"""Answers on the page: the description of a record's picture, its sentences and its tables as JSON values.

A record that is not described (see `gapwalk.picture_parts`) has its sentences and tables alone.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from gapwalk.bifurcation.branch import Branch
from gapwalk.bifurcation.loci import Locus
from gapwalk.errors import GapwalkError
from gapwalk.explorer import run_up_view  # it describes run-ups
from gapwalk.explorer.axis_quantities import quantity_words
from gapwalk.explorer.page_pictures import Json, numbers
from gapwalk.model.system import System
from gapwalk.model.words import parameter_words
from gapwalk.picture_parts import Cells, Cloud, Description, End, Panel, Parts, Picture, Series, Whole, description_of
from gapwalk.plot.picture import lay_out, picture_of, png_bytes, sheet_bytes
from gapwalk.plot.style import in_style
from gapwalk.studies.study_kind import Finding
from gapwalk.summary import Table, text_of

del run_up_view

_ROWS = 60  # of a table
_DPI = 110  # of pictures of surfaces, whose facets would be megabytes as vectors
_MOST = 250_000  # cells that a page draws without waiting; of more, every second (third, ...) of a row and a column


class AnswerView:
    """Content of the page for one record. Amounts are in the units of the model."""

    def __init__(self, found: Any) -> None:
        """Take the finding of a study, or the record of a Python function."""
        self.finding = found if isinstance(found, Finding) else None
        self.record: Any = found if self.finding is None else self.finding.record
        described = description_of(type(self.record))
        options = {} if described is None else _asked(self.finding, described)
        self.picture = Picture(None) if described is None else described.describe(self.record, **options)

    def curves(self) -> list[tuple[str, Branch | Locus]]:
        """Return its branches and loci with their names; branches come first."""
        return [(each.name, each.curve) for each in self.picture.curves]

    @property
    def axes(self) -> tuple[str, str] | None:
        """Names of the quantities of the axes over which it is shown; None if it has no place in a diagram."""
        return self.picture.axes

    @property
    def system(self) -> System:
        """The system of the record."""
        return self.picture.system or self.record.system

    def sentences(self) -> list[str]:
        """Return the answer in sentences; of unfinished work without a record, how much is stored."""
        first = [part for part in self._summary()[:1] if isinstance(part, str)]
        return list(self.picture.sentences) or first or ([] if self.finding is None else [self.finding.stored])

    def content(self) -> Json:
        """Return all of it as JSON values."""
        sentences, picture, finding = self.sentences(), self.picture, self.finding
        rest = [part for part in self._summary() if part not in sentences]
        notes = () if finding is None or self.record is None else (*finding.notes, *finding.failures)
        return {
            "sentences": sentences,
            "parts": [_plain(part) for part in rest if part != ""],
            "notes": list(notes),
            "contacts": list(picture.contacts),
            "axes": self.axes,
            "complete": getattr(finding or self.record, "complete", True),
            "pictures": [each.text for each in picture.wholes],
            **self._drawn(picture.parts()),
        }

    def _drawn(self, parts: Parts) -> Json:
        drawn: Json = {"ends": [end for each in parts.ends if (end := self._end(each)) is not None]}
        for each in fields(parts):
            if each.name not in ("ends", "paper", "more", "within", "quantities"):
                drawn[each.name] = [self.json_of(item) for item in getattr(parts, each.name)]
        drawn["within"] = {name: list(ends) for name, ends in parts.within.items()}
        drawn["quantities"] = quantity_words(parts.quantities, self.system) if parts.quantities else []
        return {name: value for name, value in drawn.items() if value} | dict(parts.more)

    def json_of(self, part: Any) -> Json:
        """Return a part of a picture as JSON values."""
        match part:
            case Series():
                drawn = {"x": numbers(part.x), "y": numbers(part.y), "axes": list(part.axes)}
                return drawn | {name: getattr(part, name) for name in ("mark", "look", "text", "of")}
            case Panel():
                across, lines = part.across or parameter_words(part.over, self.system.units), part.series
                if part.logarithmic:
                    across, lines = f"{across}, power of ten", [each._replace(x=np.log10(each.x)) for each in lines]
                drawn = {name: getattr(part, name) for name in ("title", "over", "of", "fitted")}
                series = [self.json_of(line) for each in lines for line in _lines(each)]
                return drawn | {"across": across, "series": series}
            case Cloud():
                place = self.picture.place_of(part.special)
                drawn = {"x": numbers(part.x), "quantiles": numbers(part.quantiles), "place": place, "special": None}
                return part._asdict() | drawn
            case Cells():
                every = max(1, int(np.ceil(np.sqrt(part.codes.size / _MOST))))
                return {
                    "axes": list(self.axes or ()),
                    "within": [list(ends) for ends in part.within],
                    "rows": part.codes[::every, ::every].tolist(),
                    "entries": [_entry(*each) for each in part.entries],
                    "of": part.of,
                }
        return part._asdict()

    def _end(self, end: End) -> Json | None:
        """Return a place that the answer names; None if it is a special point of none of the curves."""
        from gapwalk.explorer.motion_panels import gradient_content  # panels know the results, and these their answers

        place = {} if end.gradient else self.picture.place_of(end.special)
        if place is None:
            return None
        found: Json = {"text": end.text, "kind": end.kind, "of": end.of, **place}
        if end.gradient is None:
            return {**found, "most": end.most}
        try:
            return {**found, "place": end.place, "gradient": gradient_content(end.gradient())}
        except GapwalkError as error:
            return {**found, "place": end.place, "gradient": {"reason": str(error)}}

    def _summary(self) -> Sequence[Any]:
        of = self.finding or self.record
        parts = () if self.record is None else of.summary() if hasattr(of, "summary") else (repr(of),)
        return [part.strip("\n") if isinstance(part, str) else part for part in parts]


def _asked(finding: Finding | None, described: Description) -> Json:
    """Return those options of a picture that the study names."""
    asked = getattr(finding, "asked", None) or getattr(finding, "options", None)
    names = {each.name for each in described.options} & {"measure", "signal"}
    return {name: value for name in names if (value := getattr(asked, name, ""))}


def _lines(series: Series) -> Iterator[Series]:
    """Yield a series as the page draws it: what lies between two lines, as both lines; nothing of a text alone."""
    if series.mark == "none":
        return
    if series.mark != "between":
        yield series
        return
    for k, y in enumerate(np.asarray(series.y)):
        yield series._replace(y=y, mark="line", text="" if k else series.text)


def _entry(text: str, color: str) -> Json:
    """Return the entry of a code of cells: with a colour of its own, or with a tint of the style sheet."""
    if color.startswith("#"):
        return {"tint": "", "color": color, "wild": False, "text": text}
    return {"tint": color.removesuffix("-wild"), "wild": color.endswith("-wild"), "text": text}


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


def has_picture(record: object) -> bool:
    """Return True if the page draws a record of this type, and shows more than sentences and tables."""
    return description_of(type(record)) is not None


def drawn_on_paper(whole: Whole) -> dict[str, str]:
    """Draw a picture of `gapwalk.plot`; return its words, its form and its content: an SVG, or a PNG in base64."""
    figure = picture_of(whole.record, **whole.options)
    if whole.form == "svg":
        content = sheet_bytes(figure, "svg").decode()
    else:
        lay_out(figure)
        with in_style():
            content = base64.b64encode(png_bytes(figure, _DPI)).decode()
    return {"text": whole.text, "form": whole.form, "content": content}
