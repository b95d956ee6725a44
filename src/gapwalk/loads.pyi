"""Public names of `gapwalk.loads`; see `gapwalk.lazy_names`."""

from .model.loads import Harmonic as Harmonic
from .model.loads import Levels as Levels
from .model.loads import Line as Line
from .model.loads import Load as Load
from .model.loads import Rectangle as Rectangle
from .model.loads import register as register
from .model.parameter import Parameter as Parameter
