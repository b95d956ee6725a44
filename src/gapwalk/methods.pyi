"""Public names of `gapwalk.methods`; see `gapwalk.lazy_names`."""

from .model.coefficients import ParameterLine as ParameterLine
from .orbit import Method as Method
from .orbit import register as register
from .orbit.orbit_equation import OrbitEquation as OrbitEquation
