"""Properties of one motion: spectra, sections, rattle, Lyapunov exponents, force-deflection loops.

Functions: `contrast`, `energy`, `gradients`, `hysteresis`, `impact_plane`, `lyapunov`, `match`, `measured_parts`,
`rattle`, `section`, `sound`, `spectrum`, `spread_in_percent`, `stick_slip`, `strobe`, `waterfall`.

Classes: `Agreement`, `BatchOptions`, `ContactLoad`, `Contrast`, `Crossing`, `Energy`, `EnergyItem`, `Gradient`,
`Gradients`, `Hysteresis`, `Impact`, `Impulsiveness`, `LinePair`, `Lyapunov`, `LyapunovOptions`, `Peak`, `Phase`,
`Plane`, `Rattle`, `Regime`, `RegimeOptions`, `Section`, `SideRattle`, `SignalPair`, `Sound`, `Spectrum`,
`SpectrumOptions`, `SpreadLaw`, `Spreads`, `StickSlip`, `Strike`, `Waterfall`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
