"""Public names of `gapwalk.special_points`; see `gapwalk.lazy_names`."""

from .bifurcation.kinds import Kind as Kind
from .bifurcation.kinds import Symbol as Symbol
from .bifurcation.kinds import register as register
from .bifurcation.kinds.defining_functions import Criticality as Criticality
