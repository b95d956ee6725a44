"""Quasi-periodic motions: invariant closed curves of the stroboscopic map, and families of them."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
