"""Properties of one motion: spectra, sections, rattle, Lyapunov exponents, force-deflection loops."""

from gapwalk.attractors.attractor_catalogue import match
from gapwalk.attractors.contrast import Agreement, Contrast, SignalPair, contrast
from gapwalk.attractors.lyapunov import Lyapunov, LyapunovOptions, lyapunov
from gapwalk.attractors.rattle import Rattle, rattle
from gapwalk.attractors.regime_judge import RegimeOptions
from gapwalk.attractors.regimes import Regime
from gapwalk.attractors.section import Crossing, Plane, Section, impact_plane, section, strobe
from gapwalk.attractors.spectrum import Peak, Spectrum, SpectrumOptions, Waterfall, spectrum, waterfall
from gapwalk.flow.hysteresis import Hysteresis, hysteresis

__all__ = [
    "Agreement",
    "Contrast",
    "Crossing",
    "Hysteresis",
    "Lyapunov",
    "LyapunovOptions",
    "Peak",
    "Plane",
    "Rattle",
    "Regime",
    "RegimeOptions",
    "Section",
    "SignalPair",
    "Spectrum",
    "SpectrumOptions",
    "Waterfall",
    "contrast",
    "hysteresis",
    "impact_plane",
    "lyapunov",
    "match",
    "rattle",
    "section",
    "spectrum",
    "strobe",
    "waterfall",
]
