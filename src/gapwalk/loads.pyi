"""Public names of `gapwalk.loads`; see `gapwalk.lazy_names`."""

from .model.loads import Cylinder as Cylinder
from .model.loads import Levels as Levels
from .model.loads import Line as Line
from .model.loads import Load as Load
from .model.loads import Measured as Measured
from .model.loads import Rectangle as Rectangle
from .model.loads import Steady as Steady
from .model.loads import register as register
from .model.loads.load import FactorOverSpeed as FactorOverSpeed
from .model.measured.crank_orders import displacement_orders as displacement_orders
from .model.measured.crank_orders import orders_of as orders_of
from .model.measured.measured_table import speed_table as speed_table
from .model.measured.turned_record import turning_orders as turning_orders
