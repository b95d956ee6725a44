"""Attractors and settled motions: transients, sections, spectra, Lyapunov exponents, classification, impacts."""

from gapwalk.attractors.attractor import Attractor, AttractorKind
from gapwalk.attractors.classify import ClassifyOptions, classify, identify
from gapwalk.attractors.lyapunov import Lyapunov, LyapunovOptions, lyapunov
from gapwalk.attractors.match import distance, match
from gapwalk.attractors.rattle import Rattle, rattle
from gapwalk.attractors.rotation import Rotation, rotation
from gapwalk.attractors.section import Section, section, strobe
from gapwalk.attractors.section_plane import Crossing, Plane, impact_plane
from gapwalk.attractors.settle import SettleOptions, settle
from gapwalk.attractors.settled import Settled
from gapwalk.attractors.spectrum import Spectrum, SpectrumOptions, spectrum
from gapwalk.attractors.waterfall import Waterfall, waterfall

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
