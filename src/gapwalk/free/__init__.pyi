"""Public names of `gapwalk.free`; see `gapwalk.lazy_names`."""

from .backbone_curve import BackboneOptions as BackboneOptions
from .backbone_curve import backbone as backbone
from .equilibrium_walk import follow_rest as follow_rest
from .free_shooting import FreeShooting as FreeShooting
from .free_shooting import without_excitation as without_excitation
from .free_shooting import without_losses as without_losses
from .island_births import foretell as foretell
from .self_excitation import find_self_excited as find_self_excited
from .self_excitation import follow_self_excited as follow_self_excited
from .self_excitation import self_excited as self_excited
