"""Loads, and what a load of your own needs.

Functions: `register`.

Classes: `Harmonic`, `Levels`, `Line`, `Load`, `Parameter`, `Rectangle`.
"""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
