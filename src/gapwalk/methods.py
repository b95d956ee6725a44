"""Methods that compute periodic orbits, and what a method of your own needs."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
