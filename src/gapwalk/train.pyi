"""Public names of `gapwalk.train`; see `gapwalk.lazy_names`."""

from .model.drivetrain import Bearing as Bearing
from .model.drivetrain import Counted as Counted
from .model.drivetrain import Drag as Drag
from .model.drivetrain import Force as Force
from .model.drivetrain import Friction as Friction
from .model.drivetrain import Gear as Gear
from .model.drivetrain import Inertia as Inertia
from .model.drivetrain import Planetary as Planetary
from .model.drivetrain import Shaft as Shaft
from .model.drivetrain import Train as Train
from .model.drivetrain import chain as chain
from .model.drivetrain import nondimensional as nondimensional
from .model.drivetrain import paper_numbers as paper_numbers
from .model.units import Units as Units
