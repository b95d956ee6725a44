"""The batch integrator: many motions at once, one per lane of a compiled kernel, checked against the exact flow."""

from gapwalk.motion.mass.flow import MassFlow, mass_flow_of
from gapwalk.motion.mass.options import MassOptions
from gapwalk.motion.mass.run import MassRun, MassSurvey

__all__ = ["MassFlow", "MassOptions", "MassRun", "MassSurvey", "mass_flow_of"]
