"""Measured records and special points, their comparison with computed ones, and parameters fitted to them.

Functions: `align`, `find_impact_damping`, `fit`, `fit_points`, `match_impact_damping`, `read_measurement`,
`read_points`, `read_run_up`.

Classes: `Alignment`, `Combination`, `DampingMatch`, `Estimate`, `Fit`, `FitOptions`, `FittedPoint`, `MeasuredPoint`,
`PointFit`, `Record`, `Signal`, `Tracked`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
