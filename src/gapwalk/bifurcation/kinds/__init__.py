"""The kinds of special points: one file for each, and the registry of them all."""

from gapwalk.bifurcation.kind import Kind, Symbol, register
from gapwalk.bifurcation.kinds.branch_point import BranchPointKind
from gapwalk.bifurcation.kinds.event import Event
from gapwalk.bifurcation.kinds.flip import Flip
from gapwalk.bifurcation.kinds.fold import Fold
from gapwalk.bifurcation.kinds.grazing import Grazing
from gapwalk.bifurcation.kinds.neimark_sacker import NeimarkSacker

# in the order in which tables and legends have them
Kind.FOLD = register(Fold("fold"))
Kind.FLIP = register(Flip("flip"))
Kind.NEIMARK_SACKER = register(NeimarkSacker("neimark-sacker"))
Kind.BRANCH_POINT = register(BranchPointKind("branch-point"))
Kind.GRAZING = register(Grazing("grazing"))

__all__ = ["Event", "Kind", "Symbol", "register"]
