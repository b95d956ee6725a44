"""Force laws of contacts, and what a law of your own needs.

Functions: `register`, `register_formula`, `spring_curve`, `measured_spring`.

Classes: `Corner`, `Curve`, `Edge`, `Elastic`, `Expression`, `Formula`, `HuntCrossley`, `HuntCrossleyAsPrinted`, `Law`,
`Parameter`, `Piecewise`, `Pushing`, `QuantityKind`, `StageTerms`, `Stages`, `Viscous`.

Exceptions: `FormulaError`.

Values: `CLEARANCE`, `CUBIC`, `STIFFNESS`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
