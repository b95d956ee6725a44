"""The paper: its parameter sets, its figures, and the checks against what it says of them."""

from gapwalk.paper.cases import (
    DampingReading,
    ParameterSet,
    SlopeReading,
    case,
    describe,
    frequency_responses,
    names,
    parameter_set,
)
from gapwalk.paper.reading import Reading

__all__ = [
    "DampingReading",
    "ParameterSet",
    "Reading",
    "SlopeReading",
    "case",
    "describe",
    "frequency_responses",
    "names",
    "parameter_set",
]
