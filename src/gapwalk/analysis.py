"""Properties of one motion: spectra, sections, rattle, Lyapunov exponents, force-deflection loops.

Functions: `contrast`, `hysteresis`, `impact_plane`, `lyapunov`, `match`, `rattle`, `section`, `spectrum`, `strobe`,
`waterfall`.

Classes: `Agreement`, `Contrast`, `Crossing`, `Hysteresis`, `Lyapunov`, `LyapunovOptions`, `Peak`, `Plane`, `Rattle`,
`Regime`, `RegimeOptions`, `Section`, `SignalPair`, `Spectrum`, `SpectrumOptions`, `Waterfall`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
