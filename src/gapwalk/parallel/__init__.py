"""Parallel work: pieces on local cores or on a cluster, and their progress."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
