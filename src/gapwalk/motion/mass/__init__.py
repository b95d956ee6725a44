"""Many motions at once: a compiled kernel whose lanes are trajectories, checked beside the exact flow."""

from gapwalk.motion.mass.flow import MassFlow, mass_flow_of
from gapwalk.motion.mass.options import MassOptions
from gapwalk.motion.mass.run import MassRun, MassSurvey

__all__ = ["MassFlow", "MassOptions", "MassRun", "MassSurvey", "mass_flow_of"]
