"""Properties of one motion: spectra, sections, rattle, Lyapunov exponents, force-deflection loops."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
