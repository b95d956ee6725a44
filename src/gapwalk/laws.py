"""Force laws of contacts, and what a law of your own needs.

Functions: `register`.

Classes: `Elastic`, `HuntCrossley`, `HuntCrossleyAsPrinted`, `Law`, `Parameter`, `QuantityKind`, `StageTerms`,
`Stages`, `Viscous`.

Values: `CLEARANCE`, `CUBIC`, `STIFFNESS`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
