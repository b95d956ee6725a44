"""Attractors and settled motions: transients, sections, spectra, Lyapunov exponents, classification, impacts."""

from gapwalk.attractor.attractor import Attractor, AttractorKind
from gapwalk.attractor.classify import ClassifyOptions, classify, identify
from gapwalk.attractor.lyapunov import Lyapunov, LyapunovOptions, lyapunov
from gapwalk.attractor.match import distance, match
from gapwalk.attractor.plane import Crossing, Plane, impact_plane
from gapwalk.attractor.rattle import Rattle, rattle
from gapwalk.attractor.rotation import Rotation, rotation
from gapwalk.attractor.section import Section, section, strobe
from gapwalk.attractor.settle import SettleOptions, settle
from gapwalk.attractor.settled import Settled
from gapwalk.attractor.spectrum import Spectrum, SpectrumOptions, spectrum
from gapwalk.attractor.waterfall import Waterfall, waterfall

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
