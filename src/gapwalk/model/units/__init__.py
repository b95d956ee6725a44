"""Units: texts such as ``"30 N m/deg"`` become numbers, and numbers get their units back.

Method: docs/numerics/drive-trains.md
"""

from gapwalk.model.units.kind import PACES, QuantityKind, kind_of
from gapwalk.model.units.quantity import Quantity, has_unit, read_quantity
from gapwalk.model.units.units import Unit, Units, units_of

__all__ = ["PACES", "Quantity", "QuantityKind", "Unit", "Units", "has_unit", "kind_of", "read_quantity", "units_of"]
