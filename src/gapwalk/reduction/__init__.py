"""Reduction of systems with many degrees of freedom to few, with an estimate of the error."""

from gapwalk.reduction.reduce import reduce
from gapwalk.reduction.reduction import Reduction

__all__ = ["Reduction", "reduce"]
