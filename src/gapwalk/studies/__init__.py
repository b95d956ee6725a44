"""Studies: complete jobs that a model file requests, and their execution."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
