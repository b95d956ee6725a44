"""Force laws of contacts, and what a law of your own needs."""

from gapwalk.model.laws import CLEARANCE, CUBIC, STIFFNESS, Law, Stages, StageTerms, register
from gapwalk.model.laws.elastic import Elastic
from gapwalk.model.laws.hunt_crossley import HuntCrossley, HuntCrossleyAsPrinted
from gapwalk.model.laws.viscous import Viscous
from gapwalk.model.parameter import Parameter
from gapwalk.model.units import QuantityKind

__all__ = [
    "CLEARANCE",
    "CUBIC",
    "STIFFNESS",
    "Elastic",
    "HuntCrossley",
    "HuntCrossleyAsPrinted",
    "Law",
    "Parameter",
    "QuantityKind",
    "StageTerms",
    "Stages",
    "Viscous",
    "register",
]
