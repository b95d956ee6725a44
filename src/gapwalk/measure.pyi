"""Public names of `gapwalk.measure`; see `gapwalk.lazy_names`."""

from .answers.point_fit import fit_points as fit_points
from .answers.point_fit import read_points as read_points
from .flow.motion import Signal as Signal
from .measurement.damping_match import find_impact_damping as find_impact_damping
from .measurement.damping_match import match_impact_damping as match_impact_damping
from .measurement.fit import FitOptions as FitOptions
from .measurement.fit import align as align
from .measurement.fit import fit as fit
from .measurement.measured_record import Record as Record
from .measurement.measured_record import read_measurement as read_measurement
from .measurement.measured_record import read_run_up as read_run_up
