"""Force laws of contacts: one class in one file each, and one line here.

`gapwalk.model.laws.law.Law` is the protocol, and says what a law must give.
"""

from gapwalk.model.laws.closed_form import Stages, StageShape, StageTerms, Term, closed_form_of
from gapwalk.model.laws.elastic import Elastic
from gapwalk.model.laws.hunt_crossley import HuntCrossley, HuntCrossleyAsPrinted
from gapwalk.model.laws.law import CLEARANCE, CUBIC, LAWS, STIFFNESS, Law, law_of, law_with, never_negative, register
from gapwalk.model.laws.viscous import Viscous

for _law in (Elastic, Viscous, HuntCrossley, HuntCrossleyAsPrinted):
    register(_law())

__all__ = [
    "CLEARANCE",
    "CUBIC",
    "LAWS",
    "STIFFNESS",
    "Law",
    "StageShape",
    "StageTerms",
    "Stages",
    "Term",
    "closed_form_of",
    "law_of",
    "law_with",
    "never_negative",
    "register",
]
