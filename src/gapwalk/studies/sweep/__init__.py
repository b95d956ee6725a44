"""Sweeps: settled motions over a parameter, as an experimenter sees them."""

from gapwalk.studies.sweep.options import SweepOptions, Way
from gapwalk.studies.sweep.record import Lane, Sweep
from gapwalk.studies.sweep.regime import Band
from gapwalk.studies.sweep.sweeping import sweep
from gapwalk.studies.sweep.transient import Patience

__all__ = ["Band", "Lane", "Patience", "Sweep", "SweepOptions", "Way", "sweep"]
