"""Public names of `gapwalk.methods`; see `gapwalk.lazy_names`."""

from .model.coefficients import ParameterLine as ParameterLine
from .orbit import Evaluation as Evaluation
from .orbit import Method as Method
from .orbit import Shooting as Shooting
from .orbit import register as register
from .orbit.harmonic_balance import Balance as Balance
from .orbit.orbit_equation import OrbitEquation as OrbitEquation
