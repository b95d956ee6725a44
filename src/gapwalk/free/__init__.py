"""Free motions: those without excitation.

Without losses: vibrations, their backbones, and what these foretell of forced motions. With damping: equilibria along a
parameter, their Hopf points, and the self-excited motions that begin there.

Functions: `backbone`, `find_self_excited`, `follow_rest`, `follow_self_excited`, `foretell`, `self_excited`,
`without_excitation`, `without_losses`.

Classes: `Backbone`, `BackboneEnd`, `BackboneEvent`, `BackboneEventKind`, `BackboneOptions`, `BackbonePoint`,
`Backbones`, `Foretold`, `FreeOrbit`, `FreeShooting`, `IslandBirth`, `RestEvent`, `RestEventKind`,
`RestPoint`, `Rests`, `SelfExcited`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
