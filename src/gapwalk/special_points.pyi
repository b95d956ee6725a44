"""Public names of `gapwalk.special_points`; see `gapwalk.lazy_names`."""

from .bifurcation.kinds import Symbol as Symbol
from .bifurcation.kinds import register as register
from .bifurcation.kinds.critical_multipliers import Criticality as Criticality
