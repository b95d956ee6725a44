"""Reduction of systems with many degrees of freedom to few, with an estimate of the error."""

from gapwalk.reduction.reduction import Reduction, reduce

__all__ = ["Reduction", "reduce"]
