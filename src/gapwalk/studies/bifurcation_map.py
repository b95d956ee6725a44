"""Record and options of a map: the loci in the plane of two parameters, and the sections on which they begin."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from gapwalk.bifurcation.branch import Branch, named_by_period
from gapwalk.bifurcation.loci import Codim2Point, Locus, LocusEnd, LocusPoint
from gapwalk.bifurcation.special_point import Kind, SpecialPoint
from gapwalk.continuation.curve_points import method_document, method_values
from gapwalk.errors import ModelError
from gapwalk.model.measures import full_measure
from gapwalk.model.system import System
from gapwalk.model.units import Units
from gapwalk.model.words import parameter_symbol
from gapwalk.notebook import Shown
from gapwalk.orbit.orbit import measure_names, parameter_headings
from gapwalk.studies.options import measure_values
from gapwalk.summary import SummaryParts, Table, remarks, summarizes

Ranges = tuple[tuple[float, float], tuple[float, float]]
"""The ranges of both parameters."""


@dataclass(frozen=True, eq=False)
class MapSection:
    """The branches along the first parameter at one value of the second."""

    value: float  #: Value of the second parameter.
    branches: tuple[Branch, ...]  #: The branches; none if no first orbit was found.

    @property
    def named(self) -> Iterator[tuple[str, Branch]]:
        """The branches with their names, such as ``P2-3``: the third branch of period 2 on this section."""
        return named_by_period(self.branches)


@dataclass(frozen=True, eq=False)
class Map(Shown):
    """The loci in the plane of two parameters."""

    #: first, second: Names of the parameters.
    first: str
    second: str
    within: Ranges  #: The range of each.
    loci: tuple[Locus, ...] = ()  #: The loci, in the order in which they were found.
    sections: tuple[MapSection, ...] = ()  #: The sections with the special points from which the loci were followed.
    complete: bool = False  #: False if the work was stopped before its end.
    notes: tuple[str, ...] = ()  #: Remarks, in sentences.
    failures: tuple[str, ...] = ()  #: Failures: what could not be followed, in sentences.
    tried: int = 0  #: Number of special points of the sections that are done; a resumed map continues with the next.

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches of all sections."""
        return tuple(branch for section in self.sections for branch in section.branches)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the loci, such as ``fold-3``: the third locus of folds."""
        counts: Counter[Kind] = Counter()
        names = []
        for locus in self.loci:
            counts[locus.kind] += 1
            names.append(f"{locus.kind.value}-{counts[locus.kind]}")
        return tuple(names)

    def of_kind(self, kind: Kind | str) -> tuple[Locus, ...]:
        """Return the loci of one kind."""
        return tuple(locus for locus in self.loci if locus.kind == kind)

    @summarizes
    def summary(self, measure: str | None = None) -> SummaryParts:
        """Return the loci with their ends, notes and failures, as the terminal shows them."""
        symbols = [parameter_symbol(name, self._units) for name in (self.first, self.second)]
        ranges = ", ".join(
            f"{symbol} from {low:.10g} to {high:.10g}" for symbol, (low, high) in zip(symbols, self.within, strict=True)
        )
        loci = f"{len(self.loci)} {'locus' if len(self.loci) == 1 else 'loci'}"
        yield f"{ranges}: {loci}{self._counts and f', {self._counts}'}"
        kinds = {locus.kind for locus in self.loci} or set(Kind.known())
        special = sum(each.kind in kinds for branch in self.branches for each in branch.special_points)
        values = ", ".join(f"{section.value:.6g}" for section in self.sections)
        where = "sections" if len(self.sections) > 1 else "the section"
        yield (
            f"started from {special} special point{'s' * (special != 1)} of {len(self.branches)} "
            f"branch{'es' * (len(self.branches) != 1)}, on {where} at "
            f"{symbols[1]} = {values}"
        )
        for name, locus in zip(self.names, self.loci, strict=True):
            yield f"  {name}  {locus.range_words}"
            yield from (f"    {words}" for words in locus.end_words)
        if measure is not None and any(locus.codim2_points for locus in self.loci):
            yield self._codim2_table(measure, symbols)
        yield from remarks(self.notes, self.failures)

    def _codim2_table(self, measure: str, symbols: list[str]) -> Table:
        """Return the table of the points of codimension two, by loci."""
        measure = full_measure(measure, self.loci[0].points[0].orbit.system.coordinates)
        rows, groups = [], []
        for name, locus in zip(self.names, self.loci, strict=True):
            for index, codim2 in enumerate(locus.codim2_points):
                numbers = (*codim2.cells, f"{codim2.point.measure(measure):#.8g}")
                rows.append([name if index == 0 else "", codim2.kind.value, *numbers, codim2.contact])
            groups.append(len(rows) - 1)
        return Table(
            ["locus", "point", *(f">{each}" for each in (*symbols, "angle", measure)), "contact"], rows, groups
        )

    @property
    def _units(self) -> Units | None:
        return self.branches[0].system.units if self.branches else None

    def __getitem__(self, name: str) -> Locus:
        """Return the locus with a name."""
        try:
            return self.loci[self.names.index(name)]
        except ValueError:
            raise KeyError(f"there is no locus {name}; there are {', '.join(self.names) or 'none'}") from None

    @property
    def _counts(self) -> str:
        """Numbers of loci by kind, in words."""
        kinds = ((kind, len(self.of_kind(kind))) for kind in Kind.with_locus())
        return ", ".join(f"{count} of {kind}" for kind, count in kinds if count)

    def __repr__(self) -> str:
        return f"Map({self.first}, {self.second}; loci: {self._counts or 'none'})"


def map_document(chart: Map, points: bool = True) -> dict[str, Any]:
    """Return the parts of a map other than its branches: the plane, and the loci with their points (if wanted)."""
    return {
        "plane": [
            {"parameter": name, "from": low, "to": high}
            for name, (low, high) in zip((chart.first, chart.second), chart.within, strict=True)
        ],
        "sections": [section.value for section in chart.sections],
        "loci": [locus_document(locus, name, points) for locus, name in zip(chart.loci, chart.names, strict=True)],
        "notes": list(chart.notes),
        "failures": list(chart.failures),
    }


def locus_document(locus: Locus, name: str, points: bool = True) -> dict[str, Any]:
    """Return one locus; both parameters are always given as a pair."""
    document: dict[str, Any] = {
        "name": name,
        "kind": locus.kind.value,
        "period": locus.period,
        "contact": locus.contact or None,
        "closed": locus.is_closed,
        "ends": [_end(end) for end in locus.ends],
        "codim2_points": [_codim2(point) for point in locus.codim2_points],
        "count": len(locus.points),
    }
    if points:
        document["points"] = [_point(point) for point in locus.points]
    return document


def _point(point: LocusPoint) -> dict[str, Any]:
    """`angle` is the argument of the critical multiplier; on a grazing locus the phase at which the contact touches."""
    about = {"parameters": list(point.values), "angle": point.angle, "contacts": point.orbit.pattern}
    return {**about, **method_document(point.orbit)}


def _codim2(codim2: Codim2Point) -> dict[str, Any]:
    errors = [error if math.isfinite(error) else None for error in codim2.errors]
    return {"kind": codim2.kind.value, **_point(codim2.point), "errors": errors, "contact": codim2.contact or None}


def _end(end: LocusEnd) -> dict[str, Any]:
    """`reason` is a word for programs, `text` the sentence for people."""
    return {"reason": end.reason.name.lower(), "parameters": list(end.values), "text": str(end)}


Row = Sequence[object]


def locus_rows(chart: Map, system: System, method: Sequence[str]) -> Iterator[Row]:
    """Yield the points of all loci, a row each, after the row of headings."""
    # The columns are: name and kind of the locus, period, the contact that grazes, both parameters, angle (the argument
    # of the critical multiplier in radians; of a grazing locus that at which the contact touches), contacts; maximum,
    # minimum, half the peak to peak, mean and rms of each coordinate; the state at theta = 0; the values of the method
    # under the headings `method`.
    coordinates = system.coordinates
    yield [
        *("locus", "kind", "period", "contact"),
        *parameter_headings((chart.first, chart.second), coordinates),
        *("angle", "contacts"),
        *measure_names(coordinates),
        *(f"{name}(0)" for name in system.state_names),
        *method,
    ]
    for name, locus in zip(chart.names, chart.loci, strict=True):
        for point in locus.points:
            about = (*point.values, point.angle, point.orbit.pattern, *measure_values(point))
            yield [*_head(name, locus), *about, *point.orbit.state.tolist(), *method_values(point.orbit)]


def codim2_rows(chart: Map, coordinates: Sequence[str], method: Sequence[str]) -> Iterator[Row]:
    """Yield the points of codimension two and the ends of all loci, a row each, after the row of headings."""
    # `point` says what happens: the kind, or ``begins`` and ``ends``, for which `reason` says why. The last columns are
    # the values of the method, under the headings `method`.
    yield [
        *("locus", "kind", "period", "contact", "point"),
        *parameter_headings((chart.first, chart.second), coordinates),
        *("angle", "grazing", "reason"),
        *("contacts", *measure_names(coordinates), *method),
    ]
    for name, locus in zip(chart.names, chart.loci, strict=True):
        head, (begin, end) = _head(name, locus), locus.ends
        yield _end_row(head, "begins", begin, locus.points[0])
        for codim2 in locus.codim2_points:
            point = codim2.point
            about = (codim2.kind.value, *point.values, point.angle, codim2.contact, "")
            yield [*head, *about, *_motion(point)]
        yield _end_row(head, "ends", end, locus.points[-1])


def _end_row(head: Sequence[object], word: str, end: LocusEnd, point: LocusPoint) -> Row:
    reason = f"{end.reason.value} ({end.detail})" if end.detail else end.reason.value
    return [*head, word, *end.values, point.angle, "", reason, *_motion(point)]


def _motion(point: LocusPoint) -> list[object]:
    return [point.orbit.pattern, *measure_values(point), *method_values(point.orbit)]


def _head(name: str, locus: Locus) -> list[object]:
    return [name, locus.kind.value, locus.period, locus.contact]


@dataclass(frozen=True, slots=True)
class Which:
    """Selection of the special points of a branch to be followed in two parameters."""

    kind: Kind  #: Kind of the special points; a branch point has no locus.
    #: Value that selects only the special point nearest to this value of the branch's parameter; by default all.
    near: float | None = None
    contact: str = ""  #: Contact that selects among grazing points, or a stage and side of it, such as ``stage2 -``.

    def __post_init__(self) -> None:
        if self.kind.no_locus:
            raise ModelError(self.kind.no_locus)
        if self.contact and self.kind is not Kind.GRAZING:
            raise ModelError(f"contact is for grazing points; leave it out for those of the kind {self.kind.value}")

    def of(self, specials: Sequence[SpecialPoint]) -> list[SpecialPoint]:
        """Return those of the given special points that are selected, in their order."""
        found = [special for special in specials if special.kind is self.kind and self._touches(special.contact)]
        if self.near is None or not found:
            return found
        near = self.near
        return [min(found, key=lambda special: abs(special.value - near))]

    @property
    def words(self) -> str:
        """The selection in words."""
        contact = f" of {self.contact}" if self.contact else ""
        return f"{self.kind.value}{contact}{'' if self.near is None else f' nearest to {self.near:.8g}'}"

    def _touches(self, contact: str) -> bool:
        """Return True if a special point's contact, with its stage and side, is selected."""
        return not self.contact or contact == self.contact or contact.startswith(f"{self.contact} ")
