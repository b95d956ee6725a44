"""Kinds of special points, and their registration."""

from gapwalk.bifurcation.kinds.critical_multipliers import BranchPointKind, Flip, Fold, NeimarkSacker
from gapwalk.bifurcation.kinds.grazing import Grazing
from gapwalk.bifurcation.kinds.held_stop import HeldStop
from gapwalk.bifurcation.kinds.sliding import (
    AddingSliding,
    CrossingSliding,
    GrazingSliding,
    SlipOnset,
    SwitchingSliding,
)
from gapwalk.bifurcation.kinds.user_event import Event
from gapwalk.bifurcation.special_point import Kind, Symbol, register

# in the order of tables and legends
Kind.FOLD = register(Fold("fold"))
Kind.FLIP = register(Flip("flip"))
Kind.NEIMARK_SACKER = register(NeimarkSacker("neimark-sacker"))
Kind.BRANCH_POINT = register(BranchPointKind("branch-point"))
Kind.GRAZING = register(Grazing("grazing"))
Kind.HELD_STOP = register(HeldStop("held-stop"))
Kind.CROSSING_SLIDING = register(CrossingSliding("crossing-sliding"))
Kind.SWITCHING_SLIDING = register(SwitchingSliding("switching-sliding"))
Kind.GRAZING_SLIDING = register(GrazingSliding("grazing-sliding"))
Kind.ADDING_SLIDING = register(AddingSliding("adding-sliding"))
Kind.SLIP_ONSET = register(SlipOnset("slip-onset"))

__all__ = ["Event", "Kind", "Symbol", "register"]
