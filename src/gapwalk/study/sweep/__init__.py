"""Sweeps: settled motions over a parameter, as an experimenter sees them."""

from gapwalk.study.sweep.options import SweepOptions, Way
from gapwalk.study.sweep.record import Lane, Sweep
from gapwalk.study.sweep.regime import Band
from gapwalk.study.sweep.sweeping import sweep
from gapwalk.study.sweep.transient import Patience

__all__ = ["Band", "Lane", "Patience", "Sweep", "SweepOptions", "Way", "sweep"]
