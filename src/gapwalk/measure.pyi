"""Public names of `gapwalk.measure`; see `gapwalk.lazy_names`."""

from .flow.signal import Signal as Signal
from .measurement.alignment import Alignment as Alignment
from .measurement.alignment import align as align
from .measurement.damping_match import DampingMatch as DampingMatch
from .measurement.damping_match import find_impact_damping as find_impact_damping
from .measurement.damping_match import match_impact_damping as match_impact_damping
from .measurement.fit import Estimate as Estimate
from .measurement.fit import Fit as Fit
from .measurement.fit import FitOptions as FitOptions
from .measurement.fit import fit as fit
from .measurement.measured_record import Record as Record
from .measurement.read_record import read_measurement as read_measurement
