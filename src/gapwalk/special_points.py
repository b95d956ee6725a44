"""Kinds of special points of branches, and what a kind of your own needs."""

from gapwalk.bifurcation.kinds import Event, Kind, Symbol, register
from gapwalk.bifurcation.kinds.condition import Criticality

__all__ = ["Criticality", "Event", "Kind", "Symbol", "register"]
