"""Free motions: those without excitation.

Without losses: vibrations, their backbones, and what these foretell of forced motions. With damping: equilibria along a
parameter, their Hopf points, and the self-excited motions that begin there.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
