"""Where it changes: special points found and located along a branch."""

from gapwalk.bifurcation.detect import Detector
from gapwalk.bifurcation.follow import Trail, follow

__all__ = ["Detector", "Trail", "follow"]
