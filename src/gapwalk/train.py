"""Drive trains: their parts, chains of equal parts, scales, and the numbers of Padmanabhan and Singh (1995)."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
