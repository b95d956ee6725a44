"""The periodic motion that a job of the paper has settled on."""

from __future__ import annotations

from gapwalk.orbit.orbit import Orbit
from gapwalk.study.result import Result
from gapwalk.study.settle.finding import SettleFinding


def orbit_of(result: Result) -> Orbit:
    """The periodic motion that a job has settled on."""
    assert isinstance(result.finding, SettleFinding)
    orbit = result.finding.attractor.orbit
    assert orbit is not None
    return orbit
