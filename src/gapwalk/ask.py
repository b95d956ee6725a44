"""Questions that engineers ask of a machine with gaps: where it rattles, what makes it stop, and how sure that is."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
