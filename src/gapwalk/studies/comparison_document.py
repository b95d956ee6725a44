"""The comparison of two results as plain JSON values, for other programs."""

from __future__ import annotations

from typing import Any

from gapwalk.studies.comparison import Lone, Pair, ResultComparison


def comparison_document(found: ResultComparison, tolerance: float) -> dict[str, Any]:
    """What two results have in common, and what not; shares are those of the ranges."""
    return {
        "agree": found.within(tolerance),
        "tolerance": tolerance,
        "methods": [result.walked.method.name for result in found.results],
        "parameters": list(found.parameters),
        "ranges": list(found.ranges),
        "measures": list(found.measures),
        "largest": found.largest,
        "largest_shift": found.largest_shift,
        "pairs": [_pair(pair, tolerance) for pair in found.pairs],
        "only_first": list(found.only[0]),
        "only_second": list(found.only[1]),
        "notes": list(found.notes),
    }


def _pair(pair: Pair, tolerance: float) -> dict[str, Any]:
    return {
        "names": list(pair.names),
        "agree": pair.within(tolerance),
        "largest": pair.largest,
        "at": list(pair.worst),
        "resolution": pair.resolution,
        "covered": [list(each) for each in pair.covered],
        "missing": pair.missing,
        "special_points": [
            {
                "label": shift.label,
                "first": list(shift.first),
                "second": list(shift.second),
                "differences": list(shift.differences),
                "share": shift.share,
            }
            for shift in pair.shifts
        ],
        "only_first": [_lone(each) for each in pair.only[0]],
        "only_second": [_lone(each) for each in pair.only[1]],
    }


def _lone(lone: Lone) -> dict[str, Any]:
    return {"label": lone.label, "parameters": list(lone.values)}
