"""Measured records, their comparison with computed orbits, and parameters fitted to them."""

from gapwalk.flow.signal import Signal
from gapwalk.measurement.alignment import Alignment, align
from gapwalk.measurement.damping_match import DampingMatch, find_impact_damping, match_impact_damping
from gapwalk.measurement.fit import Fit, FitOptions, fit
from gapwalk.measurement.measured_record import Record
from gapwalk.measurement.misfit import Estimate
from gapwalk.measurement.read_record import read_measurement

__all__ = [
    "Alignment",
    "DampingMatch",
    "Estimate",
    "Fit",
    "FitOptions",
    "Record",
    "Signal",
    "align",
    "find_impact_damping",
    "fit",
    "match_impact_damping",
    "read_measurement",
]
