"""The loci of a map as rows of tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gapwalk.bifurcation.loci import Locus, LocusEnd, LocusPoint
from gapwalk.studies.columns import measure_names, measure_values, method_values, parameter_headings
from gapwalk.studies.map.chart import Map

Row = Sequence[object]


def locus_rows(chart: Map, coordinates: Sequence[str], method: Sequence[str]) -> Iterator[Row]:
    """The points of all loci, a row each, after the row of headings.

    The columns are: name and kind of the locus, period, the contact that grazes, both parameters, angle (the argument
    of the critical multiplier in radians; of a grazing locus that at which the contact touches), contacts; maximum,
    minimum, half the peak to peak, mean and rms of each coordinate; the state at theta = 0; what the method has to say,
    under the headings `method`.
    """
    states = [*(f"{q}(0)" for q in coordinates), *(f"{q}'(0)" for q in coordinates)]
    yield [
        *("locus", "kind", "period", "contact"),
        *parameter_headings((chart.first, chart.second), coordinates),
        *("angle", "contacts"),
        *measure_names(coordinates),
        *states,
        *method,
    ]
    for name, locus in zip(chart.names, chart.loci, strict=True):
        for point in locus.points:
            about = (*point.values, point.angle, point.orbit.pattern, *measure_values(point))
            yield [*_head(name, locus), *about, *point.orbit.state.tolist(), *method_values(point.orbit)]


def codim2_rows(chart: Map, coordinates: Sequence[str], method: Sequence[str]) -> Iterator[Row]:
    """The points of codimension two and the ends of all loci, a row each, after the row of headings.

    `point` says what happens: the kind, or ``begins`` and ``ends``, for which `reason` says why. In the end there is
    what the method has to say, under the headings `method`.
    """
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
