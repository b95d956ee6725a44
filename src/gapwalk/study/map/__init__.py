"""The map: every locus that bounds a regime in the plane of two parameters."""

from gapwalk.study.map.chart import Map, Ranges, Section
from gapwalk.study.map.charting import Report, bifurcation_map
from gapwalk.study.map.options import KINDS, MapOptions

__all__ = ["KINDS", "Map", "MapOptions", "Ranges", "Report", "Section", "bifurcation_map"]
