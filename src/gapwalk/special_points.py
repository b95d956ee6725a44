"""Kinds of special points of branches, and what a kind of your own needs."""

from gapwalk.lazy_names import lazy_names

__getattr__, __dir__ = lazy_names(__name__, __file__)
