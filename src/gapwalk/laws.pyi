"""Public names of `gapwalk.laws`; see `gapwalk.lazy_names`."""

from .model.laws import CLEARANCE as CLEARANCE
from .model.laws import CUBIC as CUBIC
from .model.laws import STIFFNESS as STIFFNESS
from .model.laws import Law as Law
from .model.laws import Stages as Stages
from .model.laws import StageTerms as StageTerms
from .model.laws import register as register
from .model.laws.contact_laws import Elastic as Elastic
from .model.laws.contact_laws import HuntCrossley as HuntCrossley
from .model.laws.contact_laws import HuntCrossleyAsPrinted as HuntCrossleyAsPrinted
from .model.laws.contact_laws import Viscous as Viscous
from .model.parameter import Parameter as Parameter
from .model.units import QuantityKind as QuantityKind
