"""Free motions: those without excitation.

Without losses: vibrations and their backbones. With damping: equilibria along a parameter, their Hopf points, and the
self-excited motions that begin there.

Functions: `backbone`, `find_self_excited`, `follow_rest`, `follow_self_excited`, `self_excited`, `without_excitation`,
`without_losses`.

Classes: `Backbone`, `BackboneEnd`, `BackboneEvent`, `BackboneEventKind`, `BackboneOptions`, `BackbonePoint`,
`Backbones`, `FreeOrbit`, `FreeShooting`, `RestEvent`, `RestEventKind`, `RestPoint`, `Rests`, `SelfExcited`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
