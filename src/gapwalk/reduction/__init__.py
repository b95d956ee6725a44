"""Systems of many degrees of freedom as systems of few, with an estimate of what that changes."""

from gapwalk.reduction.reduce import reduce
from gapwalk.reduction.reduction import Reduction

__all__ = ["Reduction", "reduce"]
