"""Public names of `gapwalk.laws`; see `gapwalk.lazy_names`."""

from .model.element_tables import measured_spring as measured_spring
from .model.laws import CLEARANCE as CLEARANCE
from .model.laws import STIFFNESS as STIFFNESS
from .model.laws import Expression as Expression
from .model.laws import Law as Law
from .model.laws import register as register
from .model.laws import register_formula as register_formula
from .model.laws.formula import FormulaError as FormulaError
from .model.laws.law import Elastic as Elastic
from .model.measured.spring_curve import spring_curve as spring_curve
from .model.registry import Parameter as Parameter
from .model.units import QuantityKind as QuantityKind
