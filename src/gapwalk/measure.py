"""Measured records and special points, their comparison with computed ones, and parameters fitted to them."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
