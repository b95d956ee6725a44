"""Force laws of contacts, and what a law of your own needs.

Functions: `register`, `register_formula`, `spring_curve`, `measured_spring`.

Classes: `Corner`, `Coulomb`, `Curve`, `Edge`, `Elastic`, `Expression`, `Formula`, `Friction`, `Host`, `HuntCrossley`,
`HuntCrossleyAsPrinted`, `Hysteretic`, `Jenkins`, `Law`, `Parameter`, `Piecewise`, `Pushing`, `QuantityKind`, `Rigid`,
`StageTerms`, `Stages`, `Viscous`.

Exceptions: `FormulaError`.

Values: `CLEARANCE`, `CUBIC`, `STIFFNESS`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
