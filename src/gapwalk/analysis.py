"""Properties of one motion: spectra, sections, rattle, Lyapunov exponents, force-deflection loops.

Functions: `contrast`, `hysteresis`, `impact_plane`, `lyapunov`, `match`, `rattle`, `section`, `spectrum`, `strobe`,
`waterfall`.

Classes: `Agreement`, `ContactLoad`, `Contrast`, `Crossing`, `Hysteresis`, `Impact`, `Impulsiveness`, `LinePair`,
`Lyapunov`, `LyapunovOptions`, `Peak`, `Plane`, `Rattle`, `Regime`, `RegimeOptions`, `Section`, `SideRattle`,
`SignalPair`, `Spectrum`, `SpectrumOptions`, `Waterfall`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
