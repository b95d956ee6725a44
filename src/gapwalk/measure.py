"""Measured records, their comparison with computed orbits, and parameters fitted to them.

Functions: `align`, `find_impact_damping`, `fit`, `match_impact_damping`, `read_measurement`.

Classes: `Alignment`, `DampingMatch`, `Estimate`, `Fit`, `FitOptions`, `Record`, `Signal`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
