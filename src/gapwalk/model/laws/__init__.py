"""Force laws of contacts: one class each, in a file of its own or of its family, and one line here.

`gapwalk.model.laws.law.Law` is the protocol, and says what a law must give.
"""

from gapwalk.model.laws.arithmetic import KINKS
from gapwalk.model.laws.formula import Expression
from gapwalk.model.laws.friction import FRICTION, HYSTERESIS, Coulomb, Friction, Hysteretic, Jenkins
from gapwalk.model.laws.law import (
    CLEARANCE,
    CUBIC,
    FORMULAS,
    LAWS,
    STIFFNESS,
    Elastic,
    Host,
    HuntCrossley,
    HuntCrossleyAsPrinted,
    Law,
    Piecewise,
    Pushing,
    Rigid,
    Stages,
    StageShape,
    StageTerms,
    Term,
    Viscous,
    closed_form_of,
    law_of,
    law_parameters,
    law_with,
    never_negative,
    register,
    register_formula,
)

for _kind in (Expression, Coulomb, Jenkins, Hysteretic):
    register_formula(_kind)
for _law in (Elastic, Viscous, HuntCrossley, HuntCrossleyAsPrinted, Piecewise, Pushing, Rigid):
    register(_law())

__all__ = [
    "CLEARANCE",
    "CUBIC",
    "FORMULAS",
    "FRICTION",
    "HYSTERESIS",
    "KINKS",
    "LAWS",
    "STIFFNESS",
    "Coulomb",
    "Expression",
    "Friction",
    "Host",
    "Hysteretic",
    "Jenkins",
    "Law",
    "Piecewise",
    "Pushing",
    "Rigid",
    "StageShape",
    "StageTerms",
    "Stages",
    "Term",
    "closed_form_of",
    "law_of",
    "law_parameters",
    "law_with",
    "never_negative",
    "register",
    "register_formula",
]
