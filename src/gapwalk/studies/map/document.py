"""The loci of a map as plain JSON values, for other programs."""

from __future__ import annotations

from typing import Any

from gapwalk.bifurcation.loci import Codim2Point, Locus, LocusEnd, LocusPoint
from gapwalk.studies.columns import method_document
from gapwalk.studies.map.chart import Map


def map_document(chart: Map, points: bool = True) -> dict[str, Any]:
    """What the document of a map has besides its branches: the plane, and the loci with their points (if wanted)."""
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
    """One locus; both parameters are always given as a pair."""
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
    """`angle` is the argument of the critical multiplier; on a grazing locus it tells when the contact touches."""
    about = {"parameters": list(point.values), "angle": point.angle, "contacts": point.orbit.pattern}
    return {**about, **method_document(point.orbit)}


def _codim2(codim2: Codim2Point) -> dict[str, Any]:
    return {"kind": codim2.kind.value, **_point(codim2.point), "contact": codim2.contact or None}


def _end(end: LocusEnd) -> dict[str, Any]:
    """`reason` is a word for programs, `text` the sentence for people."""
    return {"reason": end.reason.name.lower(), "parameters": list(end.values), "text": str(end)}
