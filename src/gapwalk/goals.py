"""Goals of a design, and the parameters that may change; see `gapwalk.design`.

Classes: `NoPoint`, `Quiet`, `PeakBelow`, `Resonance`, `Change`, `DesignOptions`, `LeastChangeOptions`, `Need`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
