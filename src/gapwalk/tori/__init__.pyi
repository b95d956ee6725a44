"""Public names of `gapwalk.tori`; see `gapwalk.lazy_names`."""

from .second_tone import Tone as Tone
from .second_tone import two_tones as two_tones
from .tongue import find_window as find_window
from .tongue import follow_tongue as follow_tongue
from .torus_equation import TorusOptions as TorusOptions
from .torus_equation import find_torus as find_torus
from .torus_tracer import follow_tori as follow_tori
