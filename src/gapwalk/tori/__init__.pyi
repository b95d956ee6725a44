"""Public names of `gapwalk.tori`; see `gapwalk.lazy_names`."""

from .locked_window import LockedWindow as LockedWindow
from .second_tone import Tone as Tone
from .second_tone import two_tones as two_tones
from .torus import Torus as Torus
from .torus_continuation import follow_tori as follow_tori
from .torus_diagram import TorusDiagram as TorusDiagram
from .torus_family import TorusEnd as TorusEnd
from .torus_family import TorusEndReason as TorusEndReason
from .torus_family import TorusEvent as TorusEvent
from .torus_family import TorusEventKind as TorusEventKind
from .torus_family import TorusFamily as TorusFamily
from .torus_family import TorusPoint as TorusPoint
from .torus_solution import TorusOptions as TorusOptions
from .torus_solution import find_torus as find_torus
