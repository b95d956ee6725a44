"""A toy special point: the sum of the multipliers vanishes, as where a pair of them is purely imaginary."""

import numpy as np

from gapwalk import Kind
from gapwalk.special_points import Criticality, Symbol, register


class ImaginaryPair(Kind):
    """The trace of the monodromy matrix is zero."""

    symbol = Symbol("imaginary pair (IP)", "IP", "P", 6.0, "purple", (0.0, (2.0, 1.0)))

    def function(self, point):
        """See `Kind.function`."""
        return point.orbit.multipliers.sum().real

    def condition(self, monodromy):
        """See `Kind.condition`."""
        unit = np.eye(len(monodromy))
        return Criticality(float(np.trace(monodromy)), unit, unit)


register(ImaginaryPair("imaginary-pair"))
