"""Free vibration: the periodic motions of a system without damping and excitation, and their backbones.

Functions: `backbone`, `without_losses`.

Classes: `Backbone`, `BackboneEnd`, `BackboneEvent`, `BackboneEventKind`, `BackboneOptions`, `BackbonePoint`,
`Backbones`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
