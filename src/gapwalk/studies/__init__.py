"""Whole jobs: what a model file asks to be studied, and its execution."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
