"""Force laws of contacts: one class each, in a file of its own or of its family, and one line here.

`gapwalk.model.laws.law.Law` is the protocol, and says what a law must give.
"""

from gapwalk.model.laws.arithmetic import KINKS
from gapwalk.model.laws.closed_form import Host, Stages, StageShape, StageTerms, Term, closed_form_of
from gapwalk.model.laws.contact_laws import Elastic, HuntCrossley, HuntCrossleyAsPrinted, Viscous
from gapwalk.model.laws.expression import Expression
from gapwalk.model.laws.friction import FRICTION, HYSTERESIS, Coulomb, Friction, Hysteretic, Jenkins
from gapwalk.model.laws.law import (
    CLEARANCE,
    CUBIC,
    FORMULAS,
    LAWS,
    STIFFNESS,
    Law,
    law_of,
    law_parameters,
    law_with,
    never_negative,
    register,
    register_formula,
)
from gapwalk.model.laws.piecewise import Piecewise
from gapwalk.model.laws.pushing import Pushing
from gapwalk.model.laws.rigid import Rigid

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
