"""Figures and claims as plain JSON values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gapwalk.paper import describe
from gapwalk.study.document import result_document
from gapwalk.study.result import Result
from reproductions.padmanabhan_singh_1995.claims import Claim, Outcome
from reproductions.padmanabhan_singh_1995.figure import Figure, View
from reproductions.padmanabhan_singh_1995.jobs import find_job
from reproductions.padmanabhan_singh_1995.loops import LOOPS

Checked = Sequence[tuple[Claim, Outcome]]
"""Claims, and what their checks have come to."""


def figure_document(
    figure: Figure, results: Mapping[str, Result], failures: Mapping[str, str], checked: Checked = ()
) -> dict[str, Any]:
    """A figure: what it shows, the results of its jobs with all points, and the claims about it."""
    return {
        "figure": figure.name,
        "kind": figure.kind.value,
        "caption": figure.caption,
        "reading": {"slope": figure.reading.slope.value, "damping": figure.reading.damping.value},
        "panels": [
            {
                "letter": panel.letter or None,
                "view": panel.view.value,
                "title": panel.title,
                "jobs": [figure.key(key) for key in panel.jobs],
                "within": None if panel.within is None else list(panel.within),
            }
            for panel in figure.panels
        ],
        "notes": notes(figure),
        "loops": _loops(figure),
        "results": {key: result_document(results[key]) for key in figure.jobs if key in results},
        "failures": {key: failures[key] for key in figure.jobs if key in failures},
        "claims": [claim_document(claim, outcome) for claim, outcome in checked],
    }


def _loops(figure: Figure) -> dict[str, Any]:
    """The loops of panels that rest on no job, by the names of their damping laws."""
    names = [name for panel in figure.panels if panel.view is View.HYSTERESIS for name in panel.names]
    return {
        name: {"loss": loop.loss, "deflection": loop.deflection.tolist(), "force": loop.force.tolist()}
        for name, loop in LOOPS.items()
        if name in names
    }


def claim_document(claim: Claim, outcome: Outcome) -> dict[str, Any]:
    """A claim, its verdict and the evidence."""
    return {
        "claim": claim.name,
        "says": claim.says,
        "verdict": outcome.verdict.value,
        "reading": outcome.reading or None,
        "evidence": outcome.evidence,
    }


def notes(figure: Figure) -> dict[str, str]:
    """What had to be decided beyond the printed tables, by the case that it is about."""
    cases = dict.fromkeys(find_job(key).case for key in figure.jobs)
    return {name: describe(name) for name in cases if describe(name)}
