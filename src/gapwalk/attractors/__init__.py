"""Attractors and settled motions: transients, sections, spectra, Lyapunov exponents, classification, impacts."""

from gapwalk.attractors.basins import distance, match
from gapwalk.attractors.lyapunov import Lyapunov, LyapunovOptions, lyapunov
from gapwalk.attractors.rattle import Rattle, rattle
from gapwalk.attractors.rotation import Rotation, rotation
from gapwalk.attractors.section import Crossing, Plane, Section, impact_plane, section, strobe
from gapwalk.attractors.settle import (
    Attractor,
    AttractorKind,
    ClassifyOptions,
    Settled,
    SettleOptions,
    classify,
    identify,
    settle,
)
from gapwalk.attractors.spectrum import Spectrum, SpectrumOptions, Waterfall, spectrum, waterfall

__all__ = [
    "Attractor",
    "AttractorKind",
    "ClassifyOptions",
    "Crossing",
    "Lyapunov",
    "LyapunovOptions",
    "Plane",
    "Rattle",
    "Rotation",
    "Section",
    "SettleOptions",
    "Settled",
    "Spectrum",
    "SpectrumOptions",
    "Waterfall",
    "classify",
    "distance",
    "identify",
    "impact_plane",
    "lyapunov",
    "match",
    "rattle",
    "rotation",
    "section",
    "settle",
    "spectrum",
    "strobe",
    "waterfall",
]
